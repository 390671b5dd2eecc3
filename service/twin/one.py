"""One scenario by a model that answers it in one call: nothing is made that is not part of the answer.

`predict` of a twin is told that, and `predict_many` the same of many; the laws in tests/twin hold both to each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from service.learning.doubt.outcomes import class_of, is_sure
from service.learning.drive.timetable import Account, Timetable
from service.physics.frames import slope_to_world
from service.physics.parameters import RoverParameters
from service.physics.scenario import Array
from service.physics.wheel_speed import slip_ratio
from service.twin.kept import kept
from service.twin.prediction import Frame
from service.twin.summary import LAST_PART, NAMED, Outcome, Summary, late_place, own_times

_SLOPE = Frame.SLOPE  # to find a member of an enumeration takes as long as an array operation


@dataclass(slots=True, eq=False)
class Asked:
    """At which times and for which parts of an answer; as `Twin.predict` takes them.

    Nobody changes one. It is not frozen: to make a frozen one takes three times as long.
    """

    time_s: Array
    frame: Frame
    band_level: float | None
    prior: bool
    speed: bool
    wheel_speed: bool

    @property
    def columns(self) -> int:
        """How many rows of `AnswersAtOnce.scenario` are shown."""
        return 5 if self.speed or self.wheel_speed else 2


@runtime_checkable
class AnswersAtOnce(Protocol):
    """A model that answers one scenario in one call: `DriveModel.scenario`."""

    def scenario(
        self, slope_rad: float, mass_kg: float, torque_nm: float, table: Timetable, columns: int
    ) -> tuple[Array, Account]:
        """Rows (columns, time) at the times shown: x and y, of 5 also speed, front and rear wheel speed; and what the
        way comes to.
        """
        ...


@kept
def table_of(time_s: Array, looks_s: tuple[float, ...]) -> Timetable:
    """When a scenario with these rising times, the last of them its horizon, is looked at. Raises ValueError."""
    own = own_times(time_s[-1:], quick=True)
    return Timetable(time_s, own, np.array(looks_s, dtype=np.float64), late_place(len(own)))


def summary_of(
    account: Account, horizon_s: float, rover: RoverParameters, likeliest: Callable[[float, float], Outcome] | None
) -> Summary:
    """What a way comes to. `likeliest` is asked, with late speed and end, where an error may change the outcome."""
    end = account.end_x_m - account.start_x_m
    late_speed, mean_speed = (account.end_x_m - account.late_x_m) / (LAST_PART * horizon_s), end / horizon_s
    found = class_of(late_speed, end)
    outcome = NAMED[found] if likeliest is None or is_sure(found, late_speed) else likeliest(late_speed, end)
    slip = slip_ratio(rover, mean_speed, account.wheels_rad_s)
    return Summary(outcome, account.end_x_m, account.end_height_m, account.path_m, mean_speed, slip)


def is_finite(account: Account) -> bool:
    """Whether all that is shown, and what the way comes to, is finite."""
    told = account.path_m, account.end_x_m, account.end_height_m, account.wheels_rad_s
    return account.finite == 1.0 and all(map(math.isfinite, told))


def trajectory_of(rows: Array, asked: Asked, slope_rad: float) -> dict[str, Array]:
    """The columns of an answer, (time,) each, from the model's rows."""
    along, normal, *fast = rows
    if asked.frame is _SLOPE:
        columns = {"time_s": asked.time_s, "x_m": along, "y_m": normal}
    else:
        across, up = slope_to_world(along, normal, slope_rad)
        columns = {"time_s": asked.time_s, "x_m": across, "z_m": up}
    if asked.speed:
        columns["speed_m_s"] = fast[0]
    if asked.wheel_speed:
        columns |= {"rear_wheel_speed_rad_s": fast[2], "front_wheel_speed_rad_s": fast[1]}
    return columns
