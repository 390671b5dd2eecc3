"""How likely a rover climbs, stalls or slides: where its outcome turns, against how wrong the force balance may be.

The outcome falls from climbing to sliding as resistance grows, so that a few offsets tell all: from where on the rover
no longer climbs, ends below its start, slides. Errors of the force balance are taken to have Student's t distribution
with four degrees of freedom, in units of `spread` times the scale there; `spread` is what makes the left-out runs' own
outcomes most likely. No probability is nearer to 0 or 1 than the number of runs supports: half a run is added to each
outcome (Krichevsky and Trofimov, 1981).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array

LATE_SPEED_M_S = 0.015  # of Chrono's runs, those that creep stay below 8 mm/s, those that climb or slide above 20
# What is believed of `spread` before runs are seen, in its logarithm. Three and five degrees of freedom instead of four
# give left-out runs the same probabilities, to 1 % of their logarithm.
_USUAL_SPREAD, _SPREAD_DEVIATION = 1.5, 0.5
_SPREADS: Array = np.geomspace(0.2, 12.0, 60)
_NEAR = 1e-9  # probabilities that are as good as the same
_ROUNDS = 8  # of halving an interval in which an outcome turns
# The borders: which of the ends (late speed, last position), and the value that it falls to there.
_OF = np.array([0, 1, 0])
_LEAST: Array = np.array([[LATE_SPEED_M_S], [0.0], [-LATE_SPEED_M_S]])

Classes = npt.NDArray[np.intp]
# From offsets (row,) and rows to late speeds (m/s) and last positions (m from the start) of scenarios, (row,) each.
Ends = Callable[[Array, npt.NDArray[np.intp]], tuple[Array, Array]]


class Class(IntEnum):
    """Columns of probabilities. Of a drive: passes, sticks, slides."""

    CLIMBS = 0
    STALLS = 1
    SLIDES = 2


_CLIMBS, _STALLS, _SLIDES = Class  # a member of an enumeration is slow to find


def classes(late_speed_m_s: Array, end_m: Array) -> npt.NDArray[np.intp]:
    """By the mean speed over the last quarter (of a drive: of as much time in which its motors drove), (scenario,).

    A rover that goes up in the end, but is still below its start (`end_m` < 0), has slid.
    """
    goes_up = late_speed_m_s > LATE_SPEED_M_S
    slides = (late_speed_m_s < -LATE_SPEED_M_S) | (goes_up & (end_m < 0))
    return np.where(slides, Class.SLIDES, np.where(goes_up, Class.CLIMBS, Class.STALLS))


def class_of(late_speed_m_s: float, end_m: float) -> Class:
    """`classes` of one rover, in plain numbers."""
    if late_speed_m_s < -LATE_SPEED_M_S or (late_speed_m_s > LATE_SPEED_M_S and end_m < 0):
        return _SLIDES
    return _CLIMBS if late_speed_m_s > LATE_SPEED_M_S else _STALLS


def is_sure(found: Class, late_speed_m_s: float) -> bool:
    """Whether an error, as often above zero as below, most probably leaves this class of a model's answer as it is.

    Where the model stalls, or has slid and goes up again, only probabilities tell.
    """
    return found is not _STALLS and not (found is _SLIDES and late_speed_m_s > 0)


def climbs(late_speed_m_s: float, end_m: float) -> bool:
    """Whether one rover neither stalls nor is below its start: larger speeds and ends change nothing."""
    return late_speed_m_s >= LATE_SPEED_M_S and end_m >= 0.0


def falls_back(late_speed_m_s: float) -> bool:
    """Whether one rover slides in the end: smaller speeds change nothing."""
    return late_speed_m_s < -LATE_SPEED_M_S


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """The offsets from which on rovers no longer go up, end below their start, and slide, (scenario,) each.

    Infinite: at no offset, or at all, within reach.
    """

    stalls_from: Array
    below_from: Array
    slides_from: Array


@dataclass(frozen=True, slots=True)
class OutcomeLaw:
    """Probabilities from borders. `spread` in units of the scale; `runs` is how many there were."""

    spread: float
    runs: int

    @classmethod
    def of(cls, true: Classes, borders: Borders, scales: Array) -> OutcomeLaw:
        """Of left-out runs: what they did, their models' borders, and the scales (fractions of the weight) there."""
        return cls(_likeliest(_likelihoods(true, borders, scales).sum(axis=1)), len(true))

    @staticmethod
    def left_out(true: Classes, borders: Borders, scales: Array) -> Array:
        """The probabilities of each run, (run, 3), from a law that was made without it."""
        each = _likelihoods(true, borders, scales)
        others = each.sum(axis=1, keepdims=True) - each
        spreads = np.array([_likeliest(column) for column in others.T])
        return _probabilities(borders, spreads * scales, max(len(true) - 1, 1))

    def probabilities(self, borders: Borders, scale: Array) -> Array:
        """Of climbing, stalling and sliding, (scenario, 3), for scales (scenario,), fractions of the weight."""
        return _probabilities(borders, self.spread * scale, self.runs)

    def likeliest(self, ends: Ends, late_speed_m_s: Array, end_m: Array, reach: Array, scale: Array) -> Classes:
        """The most probable outcome of each scenario, (scenario,): that of `probabilities` of `find_borders`.

        The same drives, without those that can no longer change which one it is.
        """
        search, width = _Search(ends, late_speed_m_s, end_m, reach), self.spread * scale
        for _ in range(_ROUNDS):
            search.halve(search.open & ~_decided(search.left, search.right, width))
        return np.asarray(self.probabilities(search.borders(), scale).argmax(axis=1))

    def sure(self, outcome: Class) -> Array:
        """Of each outcome, (3,), where errors within reach change nothing: as sure as the number of runs supports."""
        found = np.full(len(Class), 0.5)
        found[outcome] += self.runs
        return np.asarray(found / (self.runs + 1.5))

    def reach(self, scale: Array) -> Array:
        """The offset beyond which errors are rarer than the number of runs tells, (scenario,)."""
        return self._offset(1.0 - 0.5 / (self.runs + 1.5), scale)

    def surely(self, confidence: float, scale: Array) -> Array:
        """The offset that a rover must still climb against to climb with at least this probability, (scenario,).

        Infinite where so few runs support no such confidence.
        """
        return self._offset((confidence * (self.runs + 1.5) - 0.5) / self.runs, scale)

    def _offset(self, share: float, scale: Array) -> Array:
        """Which errors stay below with this probability."""
        return np.asarray(self.spread * scale * _quantile(share))


def entropy(chances: Array) -> Array:
    """Of probabilities (..., outcome) that are not zero, in nats, (...,)."""
    return np.asarray(-(chances * np.log(chances)).sum(axis=-1))


def find_borders(ends: Ends, late_speed_m_s: Array, end_m: Array, reach: Array) -> Borders:
    """The borders of scenarios; infinite beyond `reach` (scenario,).

    `late_speed_m_s` and `end_m` are those without an offset. One that climbs is driven at the upper end of its reach
    alone, one that slides at the lower: at the other end no border that counts can be. Most end alike there, which
    makes one drive; the others take eight more for each border.
    """
    search = _Search(ends, late_speed_m_s, end_m, reach)
    for _ in range(_ROUNDS):
        search.halve(search.open)
    return search.borders()


class _Search:
    """Halving between offsets on both sides of where one of the ends falls to a least value; then a straight line.

    Columns (border, scenario), a border for each of `_LEAST`: an interval's offsets and what is known there.
    """

    def __init__(self, ends: Ends, late_speed_m_s: Array, end_m: Array, reach: Array) -> None:
        """Arguments as those of `find_borders`."""
        self._ends = ends
        middle = np.stack([late_speed_m_s, end_m])
        high, low = middle.copy(), middle.copy()
        if (rows := np.flatnonzero((late_speed_m_s < LATE_SPEED_M_S) | (end_m < 0.0))).size:
            high[:, rows] = np.maximum(np.stack(ends(-reach[rows], rows)), middle[:, rows])
        if (rows := np.flatnonzero(late_speed_m_s >= -LATE_SPEED_M_S)).size:
            low[:, rows] = np.minimum(np.stack(ends(reach[rows], rows)), middle[:, rows])
        high, middle, low = high[_OF], middle[_OF], low[_OF]
        beyond, above = high < _LEAST, middle >= _LEAST
        self.open = ~beyond & (low < _LEAST)
        """Borders within reach, where there is something to halve."""
        self.left = np.where(self.open, np.where(above, 0.0, -reach), np.where(beyond, -np.inf, np.inf))
        self.right = np.where(self.open, np.where(above, reach, 0.0), self.left)
        self._upper, self._lower = np.where(above, middle, high), np.where(above, low, middle)

    def halve(self, wanted: npt.NDArray[np.bool_]) -> None:
        """Drives in the middle of the intervals that are wanted, all at once."""
        border, row = np.nonzero(wanted)
        if not len(row):
            return
        half = 0.5 * (self.left[border, row] + self.right[border, row])
        there = np.stack(self._ends(half, row))[_OF[border], np.arange(len(row))]
        over = there >= _LEAST[border, 0]
        up, down = (border[over], row[over]), (border[~over], row[~over])
        self.left[up], self._upper[up] = half[over], there[over]
        self.right[down], self._lower[down] = half[~over], there[~over]

    def borders(self) -> Borders:
        """Where they most probably are, within their intervals."""
        found = self.left.copy()
        left, right, upper, lower = (each[self.open] for each in (self.left, self.right, self._upper, self._lower))
        least = np.broadcast_to(_LEAST, found.shape)[self.open]
        part = np.clip((upper - least) / np.maximum(upper - lower, 1e-12), 0.0, 1.0)
        found[self.open] = left + (right - left) * part
        return Borders(found[0], found[1], np.maximum(found[0], found[2]))


def _probabilities(borders: Borders, width: Array, runs: int) -> Array:
    climbs = _cumulated(np.minimum(borders.stalls_from, borders.below_from) / width)
    stalls = _cumulated(borders.slides_from / width) - _cumulated(borders.stalls_from / width)
    found = np.stack([climbs, stalls, 1.0 - climbs - stalls], axis=-1)
    return np.asarray((runs * np.clip(found, 0.0, 1.0) + 0.5) / (runs + 1.5))


def _decided(left: Array, right: Array, width: Array) -> npt.NDArray[np.bool_]:
    """Whether one outcome is the most probable wherever in their intervals (border, scenario) the borders are."""
    low, high = (
        _cumulated(np.stack([np.minimum(b[0], b[1]), b[0], np.maximum(b[0], b[2])]) / width) for b in (left, right)
    )
    least = np.stack([low[0], low[2] - high[1], 1.0 - high[0] - (high[2] - low[1])])
    most = np.stack([high[0], high[2] - low[1], 1.0 - low[0] - (low[2] - high[1])])
    best = least.argmax(axis=0)
    np.put_along_axis(most, best[None], -1.0, axis=0)
    return np.asarray(least.max(axis=0) > np.maximum(most.max(axis=0), 0.0) + _NEAR)


def _likelihoods(true: Classes, borders: Borders, scales: Array) -> Array:
    """Logarithms of what each spread says of each run's own outcome, (spread, run)."""
    rows = np.arange(len(true))
    return np.stack([np.log(_probabilities(borders, spread * scales, len(true))[rows, true]) for spread in _SPREADS])


def _likeliest(likelihood: Array) -> float:
    prior = 0.5 * np.square(np.log(_SPREADS / _USUAL_SPREAD) / _SPREAD_DEVIATION)
    return float(_SPREADS[int((prior - likelihood).argmin())])


def _cumulated(t: Array) -> Array:
    """Student's t with four degrees of freedom, in closed form."""
    bounded = np.clip(t, -1e8, 1e8)
    sine = 0.5 * bounded / np.sqrt(1.0 + 0.25 * np.square(bounded))
    return np.asarray(0.5 + 0.75 * sine * (1.0 - np.square(sine) / 3.0))


@lru_cache(maxsize=64)
def _quantile(share: float) -> float:
    """The t that a share lies below (Shaw 2006, Sampling Student's t distribution, section 4)."""
    if not 0.0 < share < 1.0:
        return np.inf if share >= 1.0 else -np.inf
    product = 4.0 * share * (1.0 - share)
    root = np.cos(np.arccos(np.sqrt(product)) / 3.0) / np.sqrt(product)
    return float(np.copysign(2.0 * np.sqrt(max(root - 1.0, 0.0)), share - 0.5))
