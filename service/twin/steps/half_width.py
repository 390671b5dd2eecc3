"""How sure a rover's position underway is: half the width of a drive's band around x, to first order.

By how much x would differ if the resistance were a little larger, carried along from step to step, times the scale of
the error to expect at the places on the way, as a mean over the time in which the rover rolled. Against whole bands
(`Doubt.drive_edges`) of 30 random drives: 0.6 to 1.3 times as wide (5 to 95 %), the same in the median.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from service.learning.doubt.doubt import Doubt
from service.learning.doubt.excursions import LARGEST_ERROR, UNIT_OFFSET, remainder_m
from service.learning.doubt.meeting import places
from service.physics.scenario import Array
from service.physics.similarity import torque_ratio_of

HALF_WIDTH_LEVEL = 0.9
CARRIED = 7
"""Numbers that a rover carries for its half-width."""

PART_S = 0.5
"""At multiples of this time scales are looked up, whatever steps a rover is moved in: longer ones are cut there."""

_SAME_TIME_S = 1e-6

# How far and how much faster a rover with UNIT_OFFSET more resistance would be; sums, over the time in which it rolled,
# of scale times time and of time; the last scale, when it was looked up to hold for the time until then, and how long
# the rover has rolled since.
_SHIFT, _FASTER, _SCALES, _ROLLED, _SCALE, _LOOKED, _SINCE = range(CARRIED)
_MOST_UNITS = LARGEST_ERROR / UNIT_OFFSET
_DUE_S = PART_S - _SAME_TIME_S
_LEAST, _MOST, _SMALL = -1.0, 700.0, 1e-4  # of rate times time
_FIRST = np.zeros(1, dtype=np.intp)

Given: TypeAlias = tuple[float, float, float, float]
"""One rover's inputs: slope (rad), torque, brake (0 or 1) and duration."""


def until_look_s(time_s: float) -> float:
    """How long from a time since the start until scales are looked up next: up to PART_S, and never nothing."""
    left = PART_S * ((time_s + _SAME_TIME_S) // PART_S + 1.0) - time_s
    return left if left > 0.5 * _SAME_TIME_S else PART_S  # of a time so late that it has no such fractions


def until_looks_s(time_s: Array) -> Array:
    """The same of many."""
    left = PART_S * ((time_s + _SAME_TIME_S) // PART_S + 1.0) - time_s
    return np.asarray(np.where(left > 0.5 * _SAME_TIME_S, left, PART_S))


@dataclass(frozen=True, slots=True, eq=False)
class HalfWidths:
    """Those of one version's rovers. `carried` are (rover, CARRIED), other columns (rover,)."""

    doubt: Doubt
    _factor: float = field(init=False, repr=False)
    _pull_m_s2: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_factor", self.doubt.drive_factor(HALF_WIDTH_LEVEL))
        object.__setattr__(self, "_pull_m_s2", -self.doubt.regolith.gravity_m_s2 * UNIT_OFFSET)

    @staticmethod
    def begun(count: int) -> Array:
        """What rovers carry at the start."""
        return np.zeros((count, CARRIED))

    def carry(
        self, carried: Array, rate_per_s: Array, time_s: Array, mass_kg: Array, inputs: Array, speed_m_s: Array
    ) -> None:
        """Goes on over a time in which dv/dt = pull - rate v, in place. `inputs` as those of `Engine.advance`."""
        dt = inputs[3]
        exponent = np.minimum(np.maximum(rate_per_s * dt, _LEAST), _MOST)
        small = np.abs(exponent) < _SMALL
        divisor = np.where(small, 1.0, exponent)
        once = np.where(small, 1.0 - 0.5 * exponent, -np.expm1(-exponent) / divisor)
        twice = np.where(small, 0.5 - exponent / 6.0, (1.0 - once) / divisor)
        faster, gained = carried[:, _FASTER], self._pull_m_s2 * dt
        carried[:, _SHIFT] += (faster * once + gained * twice) * dt
        carried[:, _FASTER] = faster * (1.0 - exponent * once) + gained * once
        carried[:, _SINCE] += np.where(inputs[2] == 0.0, dt, 0.0)
        due = time_s >= carried[:, _LOOKED] + _DUE_S
        rows = np.flatnonzero(due | (carried[:, _ROLLED] == 0.0))
        if rows.size:
            carried[rows, _SCALE] = self._scales(rows, mass_kg, inputs, speed_m_s)
            rows = np.flatnonzero(due)
            rolled = carried[rows, _SINCE]
            carried[rows, _SCALES] += carried[rows, _SCALE] * rolled
            carried[rows, _ROLLED] += rolled
            carried[rows, _SINCE] = 0.0
            carried[rows, _LOOKED] = time_s[rows] + until_looks_s(time_s[rows]) - PART_S

    def carry_one(
        self, carried: Sequence[float], rate_per_s: float, time_s: float, mass_kg: float, given: Given, speed_m_s: float
    ) -> tuple[float, ...]:
        """What one rover carries then: `carry` in plain numbers, which for one are ten times faster than arrays."""
        shift, faster, scales, rolled, scale, looked, since = carried
        slope_rad, torque_nm, brake, dt = given
        exponent = min(max(rate_per_s * dt, _LEAST), _MOST)
        if abs(exponent) < _SMALL:
            once, twice = 1.0 - 0.5 * exponent, 0.5 - exponent / 6.0
        else:
            once = -math.expm1(-exponent) / exponent
            twice = (1.0 - once) / exponent
        gained = self._pull_m_s2 * dt
        shift += (faster * once + gained * twice) * dt
        faster = faster * (1.0 - exponent * once) + gained * once
        since += dt if brake == 0.0 else 0.0
        due = time_s >= looked + _DUE_S
        if due or rolled == 0.0:
            inputs, mass = np.array([[slope_rad], [torque_nm]]), np.array([mass_kg])
            scale = float(self._scales(_FIRST, mass, inputs, np.array([speed_m_s]))[0])
        if due:
            scales, rolled, since = scales + scale * since, rolled + since, 0.0
            looked = time_s + until_look_s(time_s) - PART_S
        return shift, faster, scales, rolled, scale, looked, since

    def _scales(self, rows: npt.NDArray[np.intp], mass_kg: Array, inputs: Array, speed_m_s: Array) -> Array:
        mass = mass_kg[rows]
        ratio = torque_ratio_of(self.doubt.rover, self.doubt.regolith, mass, inputs[1, rows])
        return np.asarray(self.doubt.scale.at(places(inputs[0, rows], ratio, mass, speed_m_s[rows]))[0])

    def at(self, carried: Array, time_s: Array, x_m: Array) -> Array:
        """The half-widths, m."""
        rolled = carried[:, _ROLLED]
        ever = rolled > 0.0
        times = self._factor * np.where(ever, carried[:, _SCALES] / np.where(ever, rolled, 1.0), carried[:, _SCALE])
        shift = np.minimum(times, _MOST_UNITS) * np.abs(carried[:, _SHIFT])
        return np.asarray(shift + times * remainder_m(time_s, x_m))

    def at_one(self, carried: Sequence[float], time_s: float, x_m: float) -> float:
        """That of one rover, in plain numbers."""
        rolled = carried[_ROLLED]
        times = self._factor * (carried[_SCALES] / rolled if rolled > 0.0 else carried[_SCALE])
        return min(times, _MOST_UNITS) * abs(carried[_SHIFT]) + times * float(remainder_m(time_s, x_m))
