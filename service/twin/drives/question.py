"""What is asked of a whole drive: a rover, the ground it drives over, what its motors are told, until when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.doubt.meeting import OffsetModel
from service.learning.drive.engine import Engine
from service.learning.drive.inputs import Controls
from service.learning.drive.state import State
from service.physics.scenario import Array
from service.twin.drives.ground import Ground, require_rising
from service.twin.twin import Twin

LONGEST_S = 600.0
HORIZON_S = 20.0
"""How long a drive lasts where nobody says how long, nor until where."""


class Driver(OffsetModel, Protocol):
    """A model that drives over any ground under any controls: the drive model."""

    @property
    def engine(self) -> Engine:
        """What moves the rover."""
        ...

    def start(self, mass_kg: float, slope_rad: float, start_speed_m_s: float | None = None) -> State:
        """A rover at the start of a drive; without a speed it is parked and let go."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class DriveQuestion:
    """Without `start_speed_m_s` the rover is parked and let go. The drive ends at the horizon, or where the rear wheel
    reaches `until_distance_m`, whichever comes first.

    Raises InvalidValueError for a mass, speed, horizon or distance that cannot be.
    """

    mass_kg: float
    ground: Ground
    controls: Controls
    start_speed_m_s: float | None = None
    horizon_s: float = HORIZON_S
    until_distance_m: float | None = None

    def __post_init__(self) -> None:
        speed, distance = self.start_speed_m_s, self.until_distance_m
        for field, allowed, fits in (
            ("mass_kg", "positive and finite", 0 < self.mass_kg < math.inf),
            ("horizon_s", f"more than 0, up to {LONGEST_S:g}", 0 < self.horizon_s <= LONGEST_S),
            ("until_distance_m", "more than 0 and finite", distance is None or 0 < distance < math.inf),
            ("start_speed_m_s", "finite", speed is None or math.isfinite(speed)),
        ):
            if not fits:
                raise InvalidValueError(field, getattr(self, field), allowed)


def controls_of(
    time_s: Sequence[float] | Array, torque_nm: Sequence[float] | Array, brake: Sequence[bool] | None = None
) -> Controls:
    """Stall torque of each wheel's motor and brake from each time on, the first from the start.

    Raises InvalidValueError for columns of other lengths, times that do not begin at 0 and rise, negative torques and
    numbers that are not finite.
    """
    times, torques = (np.asarray(each, dtype=np.float64) for each in (time_s, torque_nm))
    braked = None if brake is None else np.asarray(brake, dtype=np.bool_)
    try:
        controls = Controls(times, torques, braked)
    except ValueError:
        _refuse_controls(times, torques, braked)
        raise
    if times[0] != 0 or not (times[1:] > times[:-1]).all():
        _refuse_controls(times, torques, braked)
    return controls


def _refuse_controls(times: Array, torques: Array, brake: npt.NDArray[np.bool_] | None) -> None:
    """Says what is wrong with columns that make no controls, by the name of the field."""
    for name, column in (("torque_nm", torques), ("brake", times if brake is None else brake)):
        if len(column) != len(times):
            raise InvalidValueError(f"controls.{name}", f"{len(column)} values", f"one for each of {len(times)} times")
    require_rising("controls.time_s", times)
    if times[0] != 0:
        raise InvalidValueError("controls.time_s", float(times[0]), "0 as the first time: what holds from the start")
    if not (np.isfinite(torques).all() and (torques >= 0).all()):
        wrong = float(torques[int(np.argmin(np.isfinite(torques) & (torques >= 0)))])
        raise InvalidValueError("controls.torque_nm", wrong, "zero or positive, and finite")


def driver_of(twin: Twin) -> Driver:
    """The model of a twin that can drive. Raises InvalidValueError for a version of another architecture."""
    if not isinstance(getattr(twin.model, "engine", None), Engine):
        allowed = "a version with the drive model: this one only knows constant slopes and torques"
        raise InvalidValueError("model", f"{twin.name}@{twin.version}", allowed)
    return cast(Driver, twin.model)


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What the motors are told from each time on, columns (time,): torque (N m, 0 under the brake) and brake."""

    torque_nm: Array
    brake: npt.NDArray[np.bool_]

    @classmethod
    def at(cls, controls: Controls, time_s: Array) -> Told:
        """At times (s) from the start."""
        if len(controls.time_s) == 1:
            braked = bool(np.asarray(controls.brake)[0])
            torque = 0.0 if braked else controls.torque_nm[0]
            return cls(np.full(len(time_s), torque), np.full(len(time_s), braked))
        rows = np.searchsorted(controls.time_s, time_s, side="right") - 1
        brake = np.asarray(controls.brake)[rows] > 0
        return cls(np.where(brake, 0.0, controls.torque_nm[rows]), brake)

    @property
    def driven(self) -> npt.NDArray[np.bool_]:
        """Whether the motors drive, (time,)."""
        return np.asarray(self.torque_nm > 0)
