"""What a rover meets on its way, and how that compares with what other rovers met."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
import numpy.typing as npt

from service.learning.observed import ObservedRun
from service.learning.trajectory_model import TrajectoryModel
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.similarity import Numbers, torque_ratio_of

PARTS = 24  # of a drive, each of them one place
LAST_PART = 0.25
# Coordinates: tan(slope), ln(torque ratio + 0.0125), ln(mass), arcsinh(speed / 0.1 m/s). The lengths over which
# doubt is alike were chosen by leaving out each of 164 runs: half or twice of one predicts errors 1 to 5 % worse.
_LENGTHS: Array = np.array([0.11, 0.31, 0.53, 0.48])
_LEAST_RATIO, _SLOW_M_S = 0.0125, 0.1
_PART_NUMBERS: Array = np.arange(PARTS + 1.0)


class OffsetModel(TrajectoryModel, Protocol):
    """A model whose force balance can be made wrong on purpose."""

    def positions_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Positions:
        """`positions` where the resistance is larger by `offset`, a fraction of the weight, one or (scenario,)."""
        ...

    def ways_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Array:
        """The x (m) of `positions_with` alone, (scenario, time)."""
        ...

    def drive_run(self, run: ObservedRun, offset: float = 0.0) -> Positions:
        """What the model says of a recorded run, (1, time) at its times, given its slopes, controls and mass."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Meeting:
    """One rover's way: columns (time,) of what it meets at `time_s`, which rise from zero; x is where the model has it.

    `slope_rad` is that under its middle, `torque_nm` the stall torque of each wheel's motor (0: wheels free), `brake`
    whether wheels are locked.
    """

    mass_kg: float
    time_s: Array
    x_m: Array
    slope_rad: Array
    torque_nm: Array
    brake: npt.NDArray[np.bool_]

    @classmethod
    def of_run(cls, run: ObservedRun, predicted: Positions) -> Self:
        """That of a recorded run; `predicted` (1, time) is the model's."""
        return cls(run.mass_kg, run.time_s, predicted.x_m[0], run.slope_angle_rad, run.torques_nm, run.brakes)

    @property
    def driven(self) -> npt.NDArray[np.bool_]:
        """Whether the motors drive, (time,)."""
        return np.asarray((self.torque_nm > 0) & ~self.brake)

    def places(self, rover: RoverParameters, regolith: RegolithParameters) -> Array:
        """Places (part, coordinate) along the way, those without the parts in which wheels are locked; one at least."""
        part_s = float(self.time_s[-1] - self.time_s[0]) / PARTS
        ends = _PART_NUMBERS * part_s + self.time_s[0]
        x = np.interp(ends, self.time_s, self.x_m)
        speed = (x[1:] - x[:-1]) / max(part_s, 1e-9)
        rows = np.minimum(np.searchsorted(self.time_s, 0.5 * (ends[1:] + ends[:-1])), len(self.time_s) - 1)
        ratio = torque_ratio_of(rover, regolith, self.mass_kg, self.torque_nm[rows])
        found = places(self.slope_rad[rows], ratio, np.array(self.mass_kg), speed)
        rolling = ~self.brake[rows]
        return found[rolling] if rolling.any() else found


def look_times(settled_s: float) -> Array:
    """The times (s) at which a constant scenario is looked at: its speed between them says where it belongs."""
    return np.array([1.0 - LAST_PART, 1.0]) * settled_s


def settled_speed(seen_m: Array, settled_s: float) -> Array:
    """Mean speed (m/s) between the two `look_times`, (scenario,), of x there (scenario, 2)."""
    return np.asarray((seen_m[:, 1] - seen_m[:, 0]) / (LAST_PART * settled_s))


def scenario_places(
    rover: RoverParameters, regolith: RegolithParameters, scenarios: Scenarios, speed_m_s: Array
) -> Array:
    """Places (scenario, coordinate) of constant scenarios in which the rover moves at `speed_m_s` in the end."""
    ratio = torque_ratio_of(rover, regolith, scenarios.mass_kg, scenarios.torque_nm)
    return places(scenarios.slope_angle_rad, ratio, scenarios.mass_kg, speed_m_s)


def places(slope_rad: Array, torque_ratio: Numbers, mass_kg: Array, speed_m_s: Array) -> Array:
    """Places (..., coordinate): what is a length apart is one unit apart."""
    columns: tuple[Array, ...] = (
        np.tan(slope_rad),
        np.log(np.asarray(torque_ratio) + _LEAST_RATIO),
        np.log(mass_kg),
        np.arcsinh(np.asarray(speed_m_s) / _SLOW_M_S),
    )
    found = np.empty((*np.broadcast(*columns).shape, len(_LENGTHS)))
    for at, column in enumerate(columns):
        found[..., at] = column
    found /= _LENGTHS
    return found
