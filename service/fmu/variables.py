"""The variables of an FMU, in the order of their value references: those of `native/fmu.h`, which `native/fmu.c` keeps
within the same ranges.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from service.settings import LIMITS

START_SPEED_M_S = 5.0  # either way
MASS_KG = 430.0  # of the unladen rover


class Role(StrEnum):
    """Causality of a variable, in FMI's words."""

    TIME = "independent"
    INPUT = "input"
    PARAMETER = "parameter"
    OUTPUT = "output"


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable. `start` of inputs and parameters; `known_from` what decides an output before the first step."""

    name: str
    role: Role
    description: str
    unit: str | None = None  # None for a Boolean
    start: float | bool | None = None
    low: float | None = None
    high: float | None = None
    known_from: tuple[str, ...] = ()

    @property
    def boolean(self) -> bool:
        """Whether it is a Boolean, else a number."""
        return self.unit is None

    @property
    def variability(self) -> str:
        """In FMI's words."""
        if self.role is Role.PARAMETER:
            return "fixed"
        return "discrete" if self.boolean else "continuous"


_RELEASE = ("slope_deg", "mass_kg", "start_speed_m_s", "parked")
VARIABLES = (
    Variable("time", Role.TIME, "Time of the simulation", "s"),
    Variable(
        "slope_deg",
        Role.INPUT,
        "Slope of the ground under the rover's middle during the step, positive uphill",
        "deg",
        0.0,
        -LIMITS.slope_deg,
        LIMITS.slope_deg,
    ),
    Variable(
        "torque_nm", Role.INPUT, "Stall torque of each wheel's motor; 0: motors off", "N.m", 0.0, *LIMITS.torque_nm
    ),
    Variable("brake", Role.INPUT, "Wheels locked and motors off, whatever the torque", None, False),
    Variable("mass_kg", Role.PARAMETER, "Mass of the whole rover", "kg", MASS_KG, *LIMITS.mass_kg),
    Variable(
        "start_speed_m_s",
        Role.PARAMETER,
        "Speed along the slope at the start, positive uphill; only looked at if parked is false",
        "m/s",
        0.0,
        -START_SPEED_M_S,
        START_SPEED_M_S,
    ),
    Variable(
        "parked",
        Role.PARAMETER,
        "Parked on the slope of the first step and let go: it starts with the speed at which it creeps then",
        None,
        True,
    ),
    Variable("x_m", Role.OUTPUT, "Position of the rear wheel centre along the track, from where it started", "m"),
    Variable(
        "y_m",
        Role.OUTPUT,
        "Height of the rear wheel centre above the undeformed surface",
        "m",
        known_from=("slope_deg", "torque_nm", "brake", "mass_kg"),
    ),
    Variable("speed_m_s", Role.OUTPUT, "Speed along the track, positive uphill", "m/s", known_from=_RELEASE),
    Variable("rear_wheel_speed_rad_s", Role.OUTPUT, "Speed of the rear wheels", "rad/s"),
    Variable("front_wheel_speed_rad_s", Role.OUTPUT, "Speed of the front wheels", "rad/s"),
    Variable(
        "slip_ratio",
        Role.OUTPUT,
        "(R w - v) / max(|R w|, |v|), w the mean of both axles: 0 rolls, 1 spins on the spot",
        "1",
        known_from=_RELEASE,
    ),
    Variable("moving", Role.OUTPUT, "Whether it is as fast as 1 mm/s or faster", None, known_from=_RELEASE),
)
REFERENCES = {each.name: number for number, each in enumerate(VARIABLES)}
