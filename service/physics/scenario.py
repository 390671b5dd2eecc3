"""What is asked of the physics: scenarios as columns of equal length, in SI units and radians."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Scenarios:
    """Scenarios to evaluate together; every field has shape (scenario,), float64.

    `torque_nm` is the motor *stall* torque of each wheel. Raises ValueError for columns of different
    lengths, for values that are not finite, for a mass that is not positive and for a negative torque.
    """

    slope_angle_rad: Array
    mass_kg: Array
    torque_nm: Array

    def __post_init__(self) -> None:
        for name in ("slope_angle_rad", "mass_kg", "torque_nm"):
            column = np.asarray(getattr(self, name), dtype=np.float64)
            if column.ndim == 0:
                column = column[None]
            if column.ndim != 1 or not _finite(column):
                raise ValueError(f"{name} must be a finite column, got {getattr(self, name)!r}")
            object.__setattr__(self, name, column)
        if not (len(self.slope_angle_rad) == len(self.mass_kg) == len(self.torque_nm)):
            raise ValueError("slope_angle_rad, mass_kg and torque_nm must have the same length")
        if len(self) and (lowest := _lowest(self.mass_kg)) <= 0:
            raise ValueError(f"mass_kg must be positive, got {lowest}")
        if len(self) and (lowest := _lowest(self.torque_nm)) < 0:
            raise ValueError(f"torque_nm must not be negative, got {lowest}")

    @classmethod
    def of(cls, slope_deg: float, mass_kg: float, torque_nm: float) -> Scenarios:
        """One scenario, with the slope in degrees as people state it."""
        return cls(np.radians([slope_deg]), np.array([mass_kg]), np.array([torque_nm]))

    @classmethod
    def stack(cls, parts: Iterable[Scenarios]) -> Scenarios:
        """The scenarios of all parts, in order."""
        every = list(parts)
        return cls(
            np.concatenate([part.slope_angle_rad for part in every]),
            np.concatenate([part.mass_kg for part in every]),
            np.concatenate([part.torque_nm for part in every]),
        )

    def __len__(self) -> int:
        return len(self.mass_kg)


# Of a single scenario, the most frequent case, a plain number is looked at in a twentieth of the time of an array.


def _finite(column: Array) -> bool:
    return math.isfinite(column.item()) if column.size == 1 else bool(np.isfinite(column).all())


def _lowest(column: Array) -> float:
    return float(column.item() if column.size == 1 else column.min())


@dataclass(frozen=True, slots=True, eq=False)
class Positions:
    """Wheel-centre positions in the slope frame: `x_m` and `y_m`, each of shape (scenario, time), metres."""

    x_m: Array
    y_m: Array

    def samples(self, selection: slice) -> Positions:
        """Only the selected times; the arrays are views."""
        return Positions(self.x_m[:, selection], self.y_m[:, selection])


@dataclass(frozen=True, slots=True, eq=False)
class Motion(Positions):
    """Positions and how fast: `speed_m_s` along the slope, positive uphill, and how fast the wheels of each axle turn.

    Every array has shape (scenario, time). Wheel speeds are None where the model does not know them.
    """

    speed_m_s: Array
    rear_wheel_speed_rad_s: Array | None = None
    front_wheel_speed_rad_s: Array | None = None

    def samples(self, selection: slice) -> Motion:
        """Only the selected times; the arrays are views."""
        rear, front = (
            None if each is None else each[:, selection]
            for each in (self.rear_wheel_speed_rad_s, self.front_wheel_speed_rad_s)
        )
        return Motion(self.x_m[:, selection], self.y_m[:, selection], self.speed_m_s[:, selection], rear, front)
