"""What acts on a rover underway: the slope along its track, and what its motors are told over time."""

from __future__ import annotations

import math
from ctypes import addressof
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from service.learning.drive.library import ROUTE, CompiledControls, CompiledTrack, address, contiguous
from service.learning.drive.state import State
from service.physics.scenario import Array


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Slope (rad) over distance (m) along the surface: linear between knots, constant beyond them.

    Distance is zero where the rear wheel starts. The slope that acts is that under the rover's middle, half a wheelbase
    ahead of the rear wheel. Raises ValueError for no knots, other shapes, distances that do not rise, slopes that are
    vertical or steeper, and numbers that are not finite.
    """

    distance_m: Array
    slope_rad: Array
    _compiled: CompiledTrack = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("distance_m", "slope_rad"):
            object.__setattr__(self, name, contiguous(getattr(self, name)))
        if not self._fits():
            self._refuse()
        compiled = CompiledTrack(len(self.distance_m), address(self.distance_m), address(self.slope_rad))
        object.__setattr__(self, "_compiled", compiled)

    def _fits(self) -> bool:
        """Whether it is a track. Ends that are finite with values that rise between them: all are finite."""
        along, slope = self.distance_m, self.slope_rad
        return (
            along.ndim == 1
            and len(along) > 0
            and slope.shape == along.shape
            and math.isfinite(along[0])
            and math.isfinite(along[-1])
            and (len(along) == 1 or bool((along[1:] > along[:-1]).all()))
            and _less_than_vertical(slope)
        )

    def _refuse(self) -> None:
        """Says what is wrong."""
        if self.distance_m.ndim != 1 or not len(self.distance_m) or self.slope_rad.shape != self.distance_m.shape:
            raise ValueError(f"a track needs as many slopes as distances, got {self.distance_m.shape}")
        if not (np.isfinite(self.distance_m).all() and np.isfinite(self.slope_rad).all()):
            raise ValueError("distances and slopes of a track must be finite")
        if not (np.diff(self.distance_m) > 0).all():
            raise ValueError("distances of a track must rise")
        require_slopes(self.slope_rad)

    @classmethod
    def constant(cls, slope_rad: float) -> Track:
        """The same slope everywhere."""
        return cls(np.zeros(1), np.array([slope_rad]))

    def compiled(self) -> CompiledTrack:
        """As the engine has it, as long as this is kept."""
        return self._compiled


@dataclass(frozen=True, slots=True, eq=False)
class Controls:
    """Stall torque of each wheel's motor (N m) and brake from each time (s) on; the first from the start.

    Torque 0: motors off, wheels free. Brake: motors off, wheels locked, whatever the torque. Raises ValueError for
    none, other shapes, times that fall, negative torques and numbers that are not finite.
    """

    time_s: Array
    torque_nm: Array
    brake: Array | npt.NDArray[np.bool_] | None = None
    _compiled: CompiledControls = field(init=False, repr=False)

    def __post_init__(self) -> None:
        brake = np.zeros(np.shape(self.time_s)) if self.brake is None else self.brake
        for name, column in (("time_s", self.time_s), ("torque_nm", self.torque_nm), ("brake", brake)):
            object.__setattr__(self, name, contiguous(np.asarray(column, dtype=np.float64)))
        if not self._fits():
            self._refuse()
        object.__setattr__(self, "_compiled", self._laid_out())

    def _fits(self) -> bool:
        """Whether they are controls. Ends that are finite with values between them that do not fall: all are finite."""
        time, torque, brake = self.time_s, self.torque_nm, np.asarray(self.brake)
        return (
            time.ndim == 1
            and len(time) > 0
            and torque.shape == time.shape == brake.shape
            and math.isfinite(time[0])
            and math.isfinite(time[-1])
            and (len(time) == 1 or bool((time[1:] >= time[:-1]).all()))
            and bool(((torque >= 0) & (torque < np.inf) & np.isfinite(brake)).all())
        )

    def _refuse(self) -> None:
        """Says what is wrong."""
        columns = self.time_s, self.torque_nm, np.asarray(self.brake)
        if self.time_s.ndim != 1 or not len(self.time_s) or len({each.shape for each in columns}) != 1:
            raise ValueError(f"controls need as many torques and brakes as times, got {[c.shape for c in columns]}")
        if not all(np.isfinite(each).all() for each in columns):
            raise ValueError("times and torques of controls must be finite")
        if not (np.diff(self.time_s) >= 0).all():
            raise ValueError("times of controls must not fall")
        if not (self.torque_nm >= 0).all():
            raise ValueError("torques must not be negative")

    def _laid_out(self) -> CompiledControls:
        brake = np.asarray(self.brake, dtype=np.float64)
        return CompiledControls(len(self.time_s), address(self.time_s), address(self.torque_nm), address(brake))

    @classmethod
    def constant(cls, torque_nm: float) -> Controls:
        """The same torque all the time."""
        return cls(np.zeros(1), np.array([torque_nm]))

    def compiled(self) -> CompiledControls:
        """As the engine has it, as long as this is kept."""
        return self._compiled


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """One drive of many: from a state along a track under controls; `offset` is added to the resistance."""

    start: State
    track: Track
    controls: Controls
    offset: float = 0.0

    def packed(self) -> bytes:
        """As the engine has it, as long as this is kept."""
        track, controls = addressof(self.track.compiled()), addressof(self.controls.compiled())
        return ROUTE.pack(address(self.start.numbers), track, controls, self.offset)


def require_slopes(slope_rad: Array) -> None:
    """Raises ValueError for slopes that are vertical, steeper or not finite."""
    if not _less_than_vertical(slope_rad):
        raise ValueError("slopes must be less than vertical")


def _less_than_vertical(slope_rad: Array) -> bool:
    return bool((np.abs(slope_rad) < np.pi / 2).all())
