"""How a drive ends, which few of its times tell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from service.learning.doubt.excursions import late_part
from service.learning.doubt.meeting import Meeting
from service.physics.scenario import Array

_NO_SHARE = 1e-11  # less is what rounding leaves of equal steps


@dataclass(frozen=True, slots=True, eq=False)
class Ending:
    """The times (s) at which x tells it, which of its meeting's times these are (`rows`), and what each counts for the
    mean speed over the late part (1/s), (time,) each; `middle` is what `at` says of the meeting's own x.
    """

    time_s: Array
    rows: npt.NDArray[np.intp]
    shares: Array
    middle: tuple[float, float]

    @classmethod
    def of(cls, meeting: Meeting) -> Self:
        """Of what is driven at the times of a meeting."""
        seconds, steps = late_part(meeting.time_s, meeting.driven), meeting.time_s[1:] - meeting.time_s[:-1]
        weights = np.zeros(len(steps) + 2)  # of each interval's speed, and none before and after
        weights[1:-1] = seconds / np.maximum(steps, 1e-12) / max(float(seconds.sum()), 1e-12)
        shares = weights[:-1] - weights[1:]
        counted = np.abs(shares) >= _NO_SHARE
        counted[0] = counted[-1] = True
        rows = np.flatnonzero(counted)
        return cls(meeting.time_s[rows], rows, shares[rows], _ended(meeting.x_m[rows], shares[rows]))

    def at(self, x_m: Array) -> tuple[float, float]:
        """Mean late speed (m/s) and last position (m from the start), of x (time,) at its times."""
        return _ended(x_m, self.shares)


def _ended(x_m: Array, shares: Array) -> tuple[float, float]:
    return float(x_m.dot(shares)), float(x_m[-1] - x_m[0])
