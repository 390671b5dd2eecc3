"""When scenarios and drives are looked at: times as the engine reads them."""

from __future__ import annotations

from ctypes import addressof
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from service.learning.drive.library import MOST_S, CompiledTimetable, address, contiguous
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


def rising_times(time_s: Array) -> Array:
    """Times (time,) as the engine reads them. Raises ValueError for any that fall or that it does not drive to."""
    times = contiguous(time_s)
    if times.ndim != 1:
        raise ValueError(f"times must be (time,), got {times.shape}")
    if not rise(times):
        raise ValueError("times must not fall")
    require_range(times)
    return times


def sorted_times(times: Array) -> tuple[Array, npt.NDArray[np.intp]]:
    """Times (..., time) in order, and which of them each one is then."""
    order = np.argsort(times, axis=-1, kind="stable")
    back = np.empty_like(order)
    np.put_along_axis(back, order, np.broadcast_to(np.arange(order.shape[-1]), order.shape), -1)
    return np.take_along_axis(times, order, -1), back


def rise(times: Array) -> bool:
    """Whether none of the times (..., time) is before the one beside it, or is no number."""
    return bool((times[..., 1:] >= times[..., :-1]).all())


def require_range(times: Array) -> None:
    """Raises ValueError where rising times (..., time) are negative, beyond MOST_S, or no numbers."""
    if times.size and not (times[..., 0].min() >= 0 and times[..., -1].max() <= MOST_S):
        raise ValueError(f"times must be 0 to {MOST_S:g} s")
