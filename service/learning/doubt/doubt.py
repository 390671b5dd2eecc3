"""The doubt about a model of motion: bands around its answers and probabilities of outcomes, for scenarios and drives.

Cross-conformal over runs (Vovk 2015): each run is predicted by a model without it; its errors, in units of the scale
that the *other* runs lead one to expect there, are scores, and a band's offset is the scale times their quantile. The
promise is pointwise: of all times of all runs like these, that share lies inside.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.doubt import coverage, multipliers
from service.learning.doubt.ending import Ending
from service.learning.doubt.evidence import Evidence
from service.learning.doubt.excursions import LARGEST_ERROR, UNIT_OFFSET, remainder_m
from service.learning.doubt.meeting import LAST_PART, Meeting, OffsetModel, look_times, scenario_places, settled_speed
from service.learning.doubt.multipliers import Kinds
from service.learning.doubt.outcomes import (
    LATE_SPEED_M_S,
    Class,
    Ends,
    OutcomeLaw,
    classes,
    climbs,
    entropy,
    falls_back,
    find_borders,
)
from service.learning.doubt.scale import Scale
from service.learning.edges import Edges
from service.learning.observed import ObservedRun
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios

FEWEST_RUNS = 3
LOWEST_LEVEL, HIGHEST_LEVEL = multipliers.LEVELS[0], multipliers.LEVELS[-1]

_SURE_NATS = 0.01  # what counts of a force balance where the outcome is sure
_FAST_M_S = 0.1
_LADDER = (LOWEST_LEVEL, 0.9, HIGHEST_LEVEL)
_A_DRIVE = Kinds(np.array([multipliers.DRIVE]), np.zeros(1))
# The x (time,) that a drive has with each of some offsets, at some of its times.
OffsetWays = Callable[[Sequence[float], Array], Sequence[Array] | Array]


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """Immutable; safe to share by threads. `multipliers` (2, group, level) are those of x and y.

    `measured` says how bands and probabilities did on left-out runs, as JSON values; it changes no answer.
    """

    rover: RoverParameters
    regolith: RegolithParameters
    scale: Scale
    settled_s: float
    multipliers: Array
    outcomes: OutcomeLaw
    measured: Mapping[str, Any]

    @classmethod
    def calibrate(cls, runs: Sequence[ObservedRun], models: Mapping[str, OffsetModel]) -> Doubt:
        """From runs and, by name, a model that has not seen the run. Raises ValueError for fewer than three runs."""
        if len(runs) < FEWEST_RUNS:
            raise ValueError(f"doubt needs at least {FEWEST_RUNS} runs, got {len(runs)}")
        prior, evidence = models[runs[0].name].prior, Evidence.of(runs, models)
        expected = evidence.expected()
        return cls(
            rover=prior.rover,
            regolith=prior.regolith,
            scale=evidence.scale(),
            settled_s=evidence.settled_s,
            multipliers=coverage.tables(evidence, expected),
            outcomes=OutcomeLaw.of(*evidence.outcomes(), UNIT_OFFSET * expected[0]),
            measured=coverage.measure(evidence, expected),
        )

    @property
    def look_s(self) -> Array:
        """The times (s) at which the x of constant scenarios must be known, shape (look,)."""
        return look_times(self.settled_s)

    def edges(
        self, model: OffsetModel, scenarios: Scenarios, time_s: Array, level: float, centre: Positions, seen_m: Array
    ) -> Edges:
        """The band around `centre`, what the model says at `time_s` of shape (time,) or (scenario, time).

        `seen_m` (scenario, look) is the x that it says for `look_s`. Raises InvalidValueError for a level that is not
        0.5 to 0.99.
        """
        scales, kinds = self._scenario_scales(scenarios, seen_m)

        def sides(offsets: Sequence[Array]) -> Iterator[Sequence[Array] | Array]:
            count = len(scenarios)
            at_once = [offsets] if count == 1 else [[each] for each in offsets]  # all steps of many would fill memory
            for some in at_once:
                both = np.concatenate([side * each for each in some for side in (1.0, -1.0)])
                times = time_s if time_s.ndim == 1 else np.concatenate([time_s] * (2 * len(some)))
                x = model.ways_with(Scenarios.stack([scenarios] * (2 * len(some))), times, both)
                yield from x.reshape(len(some), 2, count, -1)

        edges = self._edges(sides, kinds, scales, level, centre, time_s)
        return _within(edges, centre.x_m, *self._possible(np.sin(scenarios.slope_angle_rad)[:, None], time_s))

    def drive_edges(
        self,
        drive: OffsetWays,
        meeting: Meeting,
        level: float,
        centre: Positions,
        *,
        time_s: Array | None = None,
        scales: Array | None = None,
        possible: tuple[Array, Array] | None = None,
    ) -> Edges:
        """The band around a drive's positions `centre` (1, time), at `time_s`, or else at the times of its meeting.

        `scales` are the meeting's `drive_scales`, where the caller has them, `possible` the x between which the rover
        must be, (time,) each. `drive` is asked once, for `drive_sides`.
        """
        times = meeting.time_s if time_s is None else time_s

        known = self.drive_scales(meeting) if scales is None else scales

        def sides(offsets: Sequence[Array]) -> Iterator[Sequence[Array] | Array]:
            found = [x_m[None] for x_m in drive(_both_sides(offsets), times)]
            return iter(zip(found[::2], found[1::2], strict=True))

        edges = self._edges(sides, _A_DRIVE, known, level, centre, times)
        return edges if possible is None else _within(edges, centre.x_m, *possible)

    def drive_sides(self, level: float, scales: Array) -> list[float]:
        """The offsets of a drive that its band at a level is made of."""
        return _both_sides([self._offsets(most, scales) for most in self._ladder(_A_DRIVE, level)])

    def possible_ways(self, sines: tuple[float, float], start_speed_m_s: float, time_s: Array) -> tuple[Array, Array]:
        """Between which x a drive must be: as `_possible`, where the slope's sine is between two numbers."""
        lowest, highest = (self._possible(np.array(sine), time_s) for sine in sines)
        return (
            highest[0] + min(start_speed_m_s, 0.0) * time_s,
            lowest[1] + max(start_speed_m_s, 0.0) * time_s,
        )

    def _edges(
        self,
        sides: Callable[[Sequence[Array]], Iterator[Sequence[Array] | Array]],
        kinds: Kinds,
        scales: Array,
        level: float,
        centre: Positions,
        time_s: Array,
    ) -> Edges:
        """Between the bands of two levels of the ladder, each around those of all lower levels.

        So a band of a higher level holds that of a lower one, though a model may get further against more resistance.
        """
        factors, x, y = self._factors(kinds, level), centre.x_m, centre.y_m
        low, high = x, x
        least = np.zeros(len(x))
        ladder = self._ladder(kinds, level)
        for most, (behind, ahead) in zip(ladder, sides([self._offsets(most, scales) for most in ladder]), strict=True):
            room = (most * scales[0])[:, None] * remainder_m(time_s, x)
            below = np.minimum(low, np.minimum(np.minimum(behind, ahead), x) - room)
            above = np.maximum(high, np.maximum(np.maximum(behind, ahead), x) + room)
            if most is ladder[-1]:
                share = ((factors[0] - least) / np.maximum(most - least, 1e-12))[:, None]
                below, above = low + share * (below - low), high + share * (above - high)
            low, high, least = below, above, most
        half_y = (factors[1] * scales[1])[:, None]
        return Edges(low, high, y - half_y, y + half_y)

    def _ladder(self, kinds: Kinds, level: float) -> list[Array]:
        """The multipliers for x, (scenario,) each, of the ladder's steps up to the one that reaches a level."""
        return [self._factors(kinds, step)[0] for step in _LADDER[: bisect_left(_LADDER, level) + 1]]

    @staticmethod
    def _offsets(most: Array, scales: Array) -> Array:
        return np.asarray(np.minimum(most * scales[0] * UNIT_OFFSET, LARGEST_ERROR))

    def _possible(self, sine: Array, time_s: Array) -> tuple[Array, Array]:
        """Between which x a rover from rest must be: it neither falls faster than freely nor outruns idling motors."""
        fall = 0.5 * self.regolith.gravity_m_s2 * sine * np.square(time_s)
        driven = self.rover.no_load_speed_rad_s * self.rover.wheel_radius_m * time_s
        return -np.maximum(fall, 0.0), driven + np.maximum(-fall, 0.0)

    def probabilities(
        self, model: OffsetModel, scenarios: Scenarios, horizon_s: Array, end: tuple[Array, Array], seen_m: Array
    ) -> Array:
        """Of climbing, stalling and sliding at the end of each horizon, (scenario, 3).

        `end` is what the model says of the mean speed over the last quarter and of the last position, (scenario,) each.
        """
        scale, reach, ends = self._turning(model, scenarios, horizon_s, seen_m)
        return self.outcomes.probabilities(find_borders(ends, *end, reach), scale)

    def _turning(
        self, model: OffsetModel, scenarios: Scenarios, horizon_s: Array, seen_m: Array
    ) -> tuple[Array, Array, Ends]:
        """What it takes to find where outcomes turn: scales of offsets, their reach, and ends under offsets."""
        scale = UNIT_OFFSET * self._scenario_scales(scenarios, seen_m)[0][0]

        def ends(offsets: Array, rows: npt.NDArray[np.intp]) -> tuple[Array, Array]:
            return ends_of(model, _only(scenarios, rows), horizon_s[rows], offsets)

        return scale, np.minimum(self.outcomes.reach(scale), LARGEST_ERROR), ends

    def likeliest(
        self, model: OffsetModel, scenarios: Scenarios, horizon_s: Array, end: tuple[Array, Array], seen_m: Array
    ) -> npt.NDArray[np.intp]:
        """The most probable outcome of each, (scenario,) of `Class`. Arguments as those of `probabilities`.

        An error is as often above zero as below, so that what climbs or slides without one most probably does: only
        where the model stalls, or has slid and goes up again, are probabilities needed.
        """
        found = classes(*end)
        unclear = (found == Class.STALLS) | ((found == Class.SLIDES) & (end[0] > 0))
        if (rows := np.flatnonzero(unclear)).size:
            part = end[0][rows], end[1][rows]
            scale, reach, ends = self._turning(model, _only(scenarios, rows), horizon_s[rows], seen_m[rows])
            found[rows] = self.outcomes.likeliest(ends, *part, reach, scale)
        return found

    def surely_climbs(
        self, model: OffsetModel, scenarios: Scenarios, horizon_s: Array, confidence: float, seen_m: Array
    ) -> npt.NDArray[np.bool_]:
        """Whether each climbs with at least this probability at the end of its horizon, (scenario,). One drive each.

        One that is fast after `settled_s` goes on in its direction: only the others are driven to the end.
        """
        scale = UNIT_OFFSET * self._scenario_scales(scenarios, seen_m)[0][0]
        against = np.asarray(self.outcomes.surely(confidence, scale))
        offsets = np.clip(against, -LARGEST_ERROR, LARGEST_ERROR)
        until = np.minimum(horizon_s, self.settled_s)
        late, end = ends_of(model, scenarios, until, offsets)
        found = classes(late, end)
        slow = (np.abs(late) < _FAST_M_S) | (found != np.where(late > 0, Class.CLIMBS, Class.SLIDES))
        if (rows := np.flatnonzero(slow & (horizon_s > until))).size:
            found[rows] = classes(*ends_of(model, _only(scenarios, rows), horizon_s[rows], offsets[rows]))
        return np.asarray((found == Class.CLIMBS) & (against <= LARGEST_ERROR))

    def unsure(self, model: OffsetModel, scenarios: Scenarios, horizon_s: float) -> Array:
        """How much there is to learn from simulating each scenario, (scenario,); see `worth`."""
        horizons = np.full(len(scenarios), horizon_s)
        seen = model.positions(scenarios, self.look_s).x_m
        chances = self.probabilities(model, scenarios, horizons, ends_of(model, scenarios, horizons), seen)
        return self.worth(self._scenario_scales(scenarios, seen)[0][0], chances)

    def worth(self, scale: Array, chances: Array) -> Array:
        """How much there is to learn where that is expected of offsets, (...,), and of outcomes, (..., 3).

        Entropy of the outcome beyond that of the surest one; a little of it wherever something is.
        """
        runs = self.outcomes.runs
        least = float(entropy(np.array([runs + 0.5, 0.5, 0.5]) / (runs + 1.5)))
        return np.asarray(scale * (_SURE_NATS + np.maximum(entropy(chances) - least, 0.0)))

    def drive_probabilities(
        self, drive: OffsetWays, meeting: Meeting, scales: Array | None = None, ending: Ending | None = None
    ) -> Array:
        """Of passing, sticking and sliding at the end of a drive, (3,).

        `scales` as those of `drive_edges`, `ending` is the meeting's. `drive` is asked for the times of the ending, for
        `drive_reaches` first.
        """
        scales = self.drive_scales(meeting) if scales is None else scales
        ending = Ending.of(meeting) if ending is None else ending
        middle, reaches = ending.middle, self.drive_reaches(ending, scales)
        known = dict(zip(reaches, map(ending.at, drive(reaches, ending.time_s)), strict=True))
        if climbs(*middle) and climbs(*known[reaches[0]]):
            return self.outcomes.sure(Class.CLIMBS)
        if falls_back(middle[0]) and falls_back(known[reaches[0]][0]):
            return self.outcomes.sure(Class.SLIDES)

        def ends(offsets: Array, _rows: npt.NDArray[np.intp]) -> tuple[Array, Array]:
            asked = offsets.tolist()
            if fresh := [each for each in dict.fromkeys(asked) if each not in known]:
                known.update(zip(fresh, map(ending.at, drive(fresh, ending.time_s)), strict=True))
            found = np.array([known[each] for each in asked])
            return found[:, 0], found[:, 1]

        reach = np.array([abs(reaches[0])])
        found = find_borders(ends, np.array([middle[0]]), np.array([middle[1]]), reach)
        return np.asarray(self.outcomes.probabilities(found, UNIT_OFFSET * scales[0])[0])

    def drive_reaches(self, ending: Ending, scales: Array) -> list[float]:
        """The offsets at which a drive's borders are looked for first."""
        reach = min(float(self.outcomes.reach(UNIT_OFFSET * scales[0])[0]), LARGEST_ERROR)
        late, end = ending.middle
        ahead = [-reach] if late < LATE_SPEED_M_S or end < 0.0 else []
        return [reach, *ahead] if late >= -LATE_SPEED_M_S else ahead

    def drive_scales(self, meeting: Meeting) -> Array:
        """What to expect along a drive: (2, 1), of offsets in units of UNIT_OFFSET, and of y (m)."""
        found = self.scale.at(meeting.places(self.rover, self.regolith))
        return np.asarray(found.sum(axis=1, keepdims=True) / found.shape[1])

    def drive_factor(self, level: float) -> float:
        """By how much the scale of a drive is multiplied for x. Raises InvalidValueError for a level beyond bounds."""
        return float(self._factors(_A_DRIVE, level)[0, 0])

    def _scenario_scales(self, scenarios: Scenarios, seen_m: Array) -> tuple[Array, Kinds]:
        speed = settled_speed(seen_m, self.settled_s)
        there = scenario_places(self.rover, self.regolith, scenarios, speed)
        coasts = (scenarios.slope_angle_rad < 0) | (scenarios.torque_nm == 0)
        kind = np.where(coasts, multipliers.COAST, multipliers.UPHILL)
        return self.scale.at(there), Kinds(kind, speed)

    def _factors(self, kinds: Kinds, level: float) -> Array:
        """For x and y, (2, scenario)."""
        if not LOWEST_LEVEL <= level <= HIGHEST_LEVEL:
            raise InvalidValueError("band_level", level, f"{LOWEST_LEVEL:g} to {HIGHEST_LEVEL:g}")
        if kinds is _A_DRIVE:
            return np.array([[multipliers.of_drives(table, level)] for table in self.multipliers])
        return np.stack([multipliers.at(table, kinds, level) for table in self.multipliers])


def ends_of(
    model: OffsetModel, scenarios: Scenarios, horizon_s: Array, offsets: Array | float = 0.0
) -> tuple[Array, Array]:
    """Mean speeds (m/s) over the last quarter of each horizon and last positions (m), (scenario,) each."""
    times = np.stack([(1.0 - LAST_PART) * horizon_s, horizon_s], axis=1)
    x = model.ways_with(scenarios, times, offsets)
    return np.asarray((x[:, 1] - x[:, 0]) / (LAST_PART * horizon_s)), np.asarray(x[:, 1])


def _both_sides(offsets: Sequence[Array]) -> list[float]:
    """Of one drive: each one ahead, then back."""
    return [side * float(each[0]) for each in offsets for side in (1.0, -1.0)]


def _within(edges: Edges, x_m: Array, slowest: Array, fastest: Array) -> Edges:
    """A band without what cannot be; it still holds `x_m`."""
    return replace(
        edges,
        x_low_m=np.maximum(edges.x_low_m, np.minimum(slowest, x_m)),
        x_high_m=np.minimum(edges.x_high_m, np.maximum(fastest, x_m)),
    )


def _only(scenarios: Scenarios, rows: npt.NDArray[np.intp]) -> Scenarios:
    return Scenarios(scenarios.slope_angle_rad[rows], scenarios.mass_kg[rows], scenarios.torque_nm[rows])
