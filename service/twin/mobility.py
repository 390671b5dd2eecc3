"""Should the rover drive over this slope? Outcome, speed and slip over slope x torque, and the steepest sure climb.

The whole map is one batch of the model at the few times needed. How steep a rover surely climbs is a matter of how it
settles, not of when one looks: it must climb, with the asked confidence, at the end of the longest training run, and of
twice, four times that as far as the map's horizon goes. So a longer horizon never makes a steeper slope climbable. The
probability is that of the version's doubt: the rover still climbs against the offset that errors exceed so rarely.

Versions with another kind of band, or none, look at the map's horizon: there a slope counts as climbed when the band's
lower edge at level 2c - 1 still means climbing, its half-width taken off the displacement over the last quarter, or,
without a band, when the central estimate does.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.band import Band
from service.learning.doubt.doubt import Doubt
from service.learning.drive.whole import MOST_LOOKS
from service.physics.scenario import Array, Scenarios
from service.twin.counting import Count, uncounted
from service.twin.prediction import NonFiniteError
from service.twin.scenario import Scenario
from service.twin.summary import LAST_PART, Outcome, outcomes_of
from service.twin.twin import Twin
from service.twin.whole import KnowsWholes

Cell = TypeVar("Cell")
Flags = npt.NDArray[np.bool_]

MOST_VALUES = 64  # of slopes and of torques
# Cells times horizon. On one core of the shipped champion 64 x 64 cells over 10 s take 0.2 s, and the most there can be
# (two slopes over minutes, where nearly all is the search for the steepest one) 0.3 s, and a worker with it.
MOST_CELL_SECONDS = 50_000.0
CONFIDENCE = (0.75, 0.995)  # one-sided; bands are calibrated at two-sided levels of 0.5 to 0.99
STEEPEST_STEP_DEG = 0.01
_COLUMNS = 8  # of a map that are looked at together


@dataclass(frozen=True, slots=True, eq=False)
class MobilityMap:
    """Rows are torques, columns slopes; every table has shape (torque, slope).

    `slip_ratio` is None where the wheels stand still or the version does not know how they turn. Of each torque,
    `steepest_climb_slope_deg` is the slope up to which every slope of the map is climbed, found to 0.01 deg and never
    above the steepest one asked; None when not even the lowest is, and where no cell of the torque is inside.
    `steepest_inside_domain` says whether that slope is itself inside; None where there is none. `confidence` is None
    when the version has no band: the steepest slope then follows the central estimate.
    """

    mass_kg: float
    horizon_s: float
    confidence: float | None
    slope_deg: Array
    torque_nm: Array
    outcome: tuple[tuple[Outcome, ...], ...]
    mean_speed_m_s: Array
    slip_ratio: tuple[tuple[float | None, ...], ...]
    inside_domain: Flags
    steepest_climb_slope_deg: tuple[float | None, ...]
    steepest_inside_domain: tuple[bool | None, ...]


def mobility_map(
    twin: Twin,
    mass_kg: float,
    torques_nm: Sequence[float] | Array,
    slopes_deg: Sequence[float] | Array,
    horizon_s: float,
    confidence: float,
    count: Count = uncounted,
) -> MobilityMap:
    """The map of one mass; torques and slopes must rise. Its cells are predictions, which `count` is told of.

    Raises InvalidValueError for values that are not allowed, NonFiniteError instead of answering NaN or infinity.
    """
    torques, slopes = _rising("torque_nm", torques_nm), _rising("slope_deg", slopes_deg)
    for slope in slopes:
        for torque in (torques[0], torques[-1]):
            Scenario(float(slope), mass_kg, float(torque), horizon_s)  # refuses what is not physical
    if (asked := len(torques) * len(slopes) * horizon_s) > MOST_CELL_SECONDS:
        limit = f"at most {MOST_CELL_SECONDS:g} s: ask for fewer torques or slopes, or a shorter horizon_s"
        raise InvalidValueError("torques x slopes x horizon_s", asked, limit)
    if not CONFIDENCE[0] <= confidence <= CONFIDENCE[1]:
        raise InvalidValueError("confidence", confidence, f"{CONFIDENCE[0]:g} to {CONFIDENCE[1]:g}")
    began = time.perf_counter()
    ground = _Ground(twin, mass_kg, horizon_s, confidence)
    shape = len(torques), len(slopes)
    each = np.repeat(torques, len(slopes)), np.tile(slopes, len(torques))
    cells = ground.scenarios(*each)
    motion, wheels = ground.whole_motion(cells)
    speed = motion.whole_m / horizon_s
    outcomes, inside = ground.outcomes(cells, motion), _inside(twin, mass_kg, *each, horizon_s).reshape(shape)
    found = _steepest(ground, torques, slopes, _leading(ground, torques, slopes, motion))
    steepest = tuple(slope if row.any() else None for slope, row in zip(found, inside, strict=True))
    count(twin, time.perf_counter() - began, outcomes, inside.size - int(inside.sum()))
    return MobilityMap(
        mass_kg=mass_kg,
        horizon_s=horizon_s,
        confidence=None if twin.band is None else confidence,
        slope_deg=slopes,
        torque_nm=torques,
        outcome=_rows(outcomes, shape),
        mean_speed_m_s=speed.reshape(shape),
        slip_ratio=_rows(twin.slip_ratios(cells, np.full(len(cells), horizon_s), speed, wheels), shape),
        inside_domain=inside,
        steepest_climb_slope_deg=steepest,
        steepest_inside_domain=_inside_where_known(twin, mass_kg, torques, steepest, horizon_s),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Motion:
    """Ways along the slope (m): whole horizon, its last part, (scenario,); where the band looks, (scenario, look)."""

    whole_m: Array
    last_part_m: Array
    seen_m: Array

    def only(self, rows: npt.NDArray[np.intp]) -> _Motion:
        """That of some of the scenarios."""
        return _Motion(self.whole_m[rows], self.last_part_m[rows], self.seen_m[rows])


@dataclass(frozen=True, slots=True, eq=False)
class _Ground:
    """What the cells of a map share."""

    twin: Twin
    mass_kg: float
    horizon_s: float
    confidence: float

    def scenarios(self, torques_nm: Array, slopes_deg: Array) -> Scenarios:
        return Scenarios(np.radians(slopes_deg), np.full(len(slopes_deg), self.mass_kg), torques_nm)

    def whole_motion(self, scenarios: Scenarios) -> tuple[_Motion, Array | None]:
        """`motion`, and the mean speed of the wheels, rad/s (scenario,), where the model says both in one go."""
        model, look_s = self.twin.model, self._looks()
        if not (isinstance(model, KnowsWholes) and len(look_s) <= MOST_LOOKS):
            return self.motion(scenarios), None
        whole = model.whole_ways(scenarios, np.full(len(scenarios), self.horizon_s), look_s)
        x = np.stack([np.zeros(len(scenarios)), whole.late_x_m, whole.end_x_m], axis=1)
        return self._motion(np.concatenate([x, whole.seen_m], axis=1)), whole.wheels_rad_s

    def motion(self, scenarios: Scenarios) -> _Motion:
        """The model's answer for all scenarios. Raises NonFiniteError."""
        times = np.concatenate([[0.0, (1.0 - LAST_PART) * self.horizon_s, self.horizon_s], self._looks()])
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused below
            if self.twin.doubt is not None:
                return self._motion(self.twin.offset_model.ways_with(scenarios, times, 0.0))
            return self._motion(self.twin.model.positions(scenarios, times).x_m)

    def looked(self, scenarios: Scenarios) -> _Motion:
        """`motion` as far as `climbed` needs it: with a doubt nothing but what is seen at its looks."""
        if self.twin.doubt is None:
            return self.motion(scenarios)
        seen_m = self.twin.offset_model.ways_with(scenarios, self._looks(), 0.0)
        return self._motion(np.concatenate([np.zeros((len(seen_m), 3)), seen_m], axis=1))

    def _looks(self) -> Array:
        return np.empty(0) if self.twin.band is None else self.twin.band.look_s

    def _motion(self, x_m: Array) -> _Motion:
        """Of x (scenario, 3 + look): at the start, where the last part begins, at the horizon, where the band looks."""
        start, late_m, end = x_m[:, :3].T
        with np.errstate(over="ignore", invalid="ignore"):
            motion = _Motion(end - start, end - late_m, x_m[:, 3:])
        if not all(np.isfinite(each).all() for each in (motion.whole_m, motion.last_part_m, motion.seen_m)):
            name = f"{self.twin.name}@{self.twin.version}"
            raise NonFiniteError(f"{name} has no finite answer for a mass_kg of {self.mass_kg:g} somewhere on this map")
        return motion

    def outcomes(self, scenarios: Scenarios, motion: _Motion) -> tuple[Outcome, ...]:
        """The most probable outcome of each, (scenario,)."""
        horizons = np.full(len(scenarios), self.horizon_s)
        late_speed = motion.last_part_m / (LAST_PART * self.horizon_s)
        return self.twin.likely_outcomes(scenarios, horizons, late_speed, motion.whole_m, motion.seen_m)

    def climbed(self, scenarios: Scenarios, motion: _Motion) -> Flags:
        """Whether the rover climbs with the asked confidence, shape (scenario,)."""
        if self.twin.doubt is not None:
            return self._surely_climbed(self.twin.doubt, scenarios, motion)
        lower_m = motion.last_part_m
        if isinstance(self.twin.band, Band):
            level = 2.0 * self.confidence - 1.0
            half_m, _ = self.twin.band.half_widths(scenarios, np.array([self.horizon_s]), level, motion.seen_m)
            lower_m = lower_m - half_m[:, 0]
        outcomes = outcomes_of(lower_m / (LAST_PART * self.horizon_s), motion.whole_m)
        return np.array([outcome is Outcome.CLIMBS for outcome in outcomes])

    def _surely_climbed(self, doubt: Doubt, scenarios: Scenarios, motion: _Motion) -> Flags:
        climbed, horizon = np.ones(len(scenarios), dtype=np.bool_), self.twin.settled_horizon_s
        while climbed.any():
            rows = np.flatnonzero(climbed)
            some = Scenarios(scenarios.slope_angle_rad[rows], scenarios.mass_kg[rows], scenarios.torque_nm[rows])
            horizons = np.full(len(rows), horizon)
            climbed[rows] = doubt.surely_climbs(
                self.twin.offset_model, some, horizons, self.confidence, motion.seen_m[rows]
            )
            horizon *= 2.0
            if horizon > self.horizon_s:
                break
        return climbed


def _leading(ground: _Ground, torques: Array, slopes: Array, motion: _Motion) -> npt.NDArray[np.intp]:
    """How many slopes, from the lowest on, each torque climbs without a gap, (torque,).

    Some slopes at a time: what lies beyond a gap, where rovers stall and must be driven longest, is not looked at.
    """
    leading, rows = np.zeros(len(torques), dtype=np.intp), np.arange(len(torques))
    for first in range(0, len(slopes), _COLUMNS):
        columns = np.arange(first, min(first + _COLUMNS, len(slopes)))
        row, column = (each.ravel() for each in np.meshgrid(rows, columns, indexing="ij"))
        scenarios = ground.scenarios(torques[row], slopes[column])
        climbed = ground.climbed(scenarios, motion.only(row * len(slopes) + column)).reshape(len(rows), -1)
        gapless = np.logical_and.accumulate(climbed, axis=1).sum(axis=1)
        leading[rows] += gapless
        rows = rows[gapless == len(columns)]
        if not len(rows):
            break
    return leading


def _steepest(
    ground: _Ground, torques: Array, slopes: Array, leading: npt.NDArray[np.intp]
) -> tuple[float | None, ...]:
    """Halves the step after the last slope of each torque's gapless climb, all torques at once."""
    low = slopes[np.maximum(leading - 1, 0)].copy()
    high = slopes[np.minimum(leading, len(slopes) - 1)].copy()
    rows = np.flatnonzero((leading > 0) & (leading < len(slopes)))
    while len(rows := rows[high[rows] - low[rows] > STEEPEST_STEP_DEG]):
        middle = (low[rows] + high[rows]) / 2.0
        scenarios = ground.scenarios(torques[rows], middle)
        still = ground.climbed(scenarios, ground.looked(scenarios))
        low[rows[still]] = middle[still]
        high[rows[~still]] = middle[~still]
    return tuple(float(slope) if count else None for slope, count in zip(low, leading, strict=True))


def _inside(twin: Twin, mass_kg: float, torques: Array, slopes: Array, horizon_s: float) -> Flags:
    """Whether scenarios of these torques and slopes, (scenario,) both, are inside."""
    same = np.ones(len(torques))
    return twin.domain.inside_many(slopes, mass_kg * same, torques, horizon_s * same)


def _inside_where_known(
    twin: Twin, mass_kg: float, torques: Array, slopes: Sequence[float | None], horizon_s: float
) -> tuple[bool | None, ...]:
    """The same of one slope for each torque, (torque,); None where there is none."""
    known = np.array([slope is not None for slope in slopes])
    inside = _inside(twin, mass_kg, torques, np.array([slope or 0.0 for slope in slopes]), horizon_s)
    return tuple(bool(flag) if there else None for flag, there in zip(inside, known, strict=True))


def _rows(cells: Sequence[Cell], shape: tuple[int, int]) -> tuple[tuple[Cell, ...], ...]:
    height, width = shape
    return tuple(tuple(cells[row * width : (row + 1) * width]) for row in range(height))


def _rising(field: str, values: Sequence[float] | Array) -> Array:
    column = np.asarray(values, dtype=np.float64)
    if column.ndim != 1 or not 1 <= len(column) <= MOST_VALUES or not (np.diff(column) > 0).all():
        raise InvalidValueError(field, column.tolist(), f"1 to {MOST_VALUES} rising values")
    return column
