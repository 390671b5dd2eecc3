"""When one scenario is looked at, prepared for the engine."""

from __future__ import annotations

from ctypes import addressof
from typing import NamedTuple

import numpy as np

from service.learning.drive.library import MOST_S, CompiledTimetable, address
from service.physics.scenario import Array


class Account(NamedTuple):
    """What the way of one scenario comes to, in the order of the engine's `ROVER_ACCOUNT`, SI units.

    `late_x_m` is where the last part of the way begins, `wheels_rad_s` the mean of both axles over all of it, `seen_m`
    and `seen_later_m` are x at the first two looks, `finite` is 1 where all that is shown is so.
    """

    start_x_m: float
    late_x_m: float
    end_x_m: float
    end_height_m: float
    path_m: float
    wheels_rad_s: float
    seen_m: float
    seen_later_m: float
    finite: float


class Timetable:
    """All times of three kinds in one rising row, each once, and where those of each kind are in it.

    `shown_s` are those of an answer, `own_s` those that the whole way is told by, of which number `late` is where its
    last part begins, `look_s` at most two more. Immutable; keeps what the engine reads. Raises ValueError for times
    that are negative, not finite or beyond MOST_S.
    """

    def __init__(self, shown_s: Array, own_s: Array, look_s: Array, late: int) -> None:
        self.shown = len(shown_s)
        times, places = np.unique(np.concatenate([shown_s, own_s, look_s]), return_inverse=True)
        if not 0.0 <= times[0] <= times[-1] <= MOST_S:
            raise ValueError(f"times must be 0 to {MOST_S:g} s")
        self._times, self._places = np.ascontiguousarray(times), places.astype(np.int64)
        self.times = len(times)
        first = address(self._places)
        own, looks = (first + self._places.itemsize * at for at in (self.shown, self.shown + len(own_s)))
        self._compiled = CompiledTimetable(
            self.times, address(self._times), self.shown, first, len(own_s), own, late, len(look_s), looks
        )
        self.address = addressof(self._compiled)
