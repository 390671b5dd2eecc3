"""Left-out runs against what their models say with wrong force balances: how wrong each has to be to hold the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.learning.doubt.meeting import Meeting, OffsetModel, look_times, settled_speed
from service.learning.doubt.outcomes import LATE_SPEED_M_S, classes
from service.learning.observed import ObservedRun
from service.physics.scenario import Array, Positions, Scenarios

MOST_OFFSET = 0.25  # of the weight: how far models are followed to see what a run has in reserve
LARGEST_ERROR = 0.12  # of the weight: what soil takes anyway; left-out models were off by 0.04 at most
_LEAST_OFFSET, _SIDE = 1e-4, 30
OFFSETS: Array = np.concatenate(
    [
        -np.geomspace(MOST_OFFSET, _LEAST_OFFSET, _SIDE),
        np.zeros(1),
        np.geomspace(_LEAST_OFFSET, MOST_OFFSET, _SIDE),
    ]
)
_TIMES = 121
FACTORS: Array = np.geomspace(0.02, 200.0, 121)  # of the scale; scores lie between
UNIT_OFFSET = 0.002  # of the weight: where rovers climb, models that know similar runs are off by about so much
# What no offset explains (ripples, how the rover starts), at a scale of one: 18 mm, 1.5 mm more for each metre of way.
_RIPPLE_M, _RIPPLE_S, _RIPPLE_SHARE = 0.018, 0.2, 0.0015


def remainder_m(time_s: Array | float, way_m: Array | float) -> Array:
    """What is left of an error of scale one when the best offset is taken off, at times and ways (m from the start)."""
    return np.asarray(_RIPPLE_M * (1.0 - np.exp(-time_s / _RIPPLE_S)) + _RIPPLE_SHARE * np.abs(way_m))


@dataclass(frozen=True, slots=True, eq=False)
class Excursion:
    """One left-out run at some hundred times: `x_m` (offset, time) for each of OFFSETS, the run's own `true_x_m`.

    `y_error_m` (time,) is that of the model without offset; `meeting` is what the model meets, at all times of the run.
    """

    run: ObservedRun
    meeting: Meeting
    x_m: Array
    true_x_m: Array
    y_error_m: Array
    time_s: Array

    @classmethod
    def of(cls, run: ObservedRun, model: OffsetModel) -> Excursion:
        """What a model that has not seen the run says of it. Raises ValueError for an answer that is not finite."""
        central = model.drive_run(run)
        chosen = np.unique(np.linspace(0, len(run.time_s) - 1, _TIMES).round().astype(np.intp))
        kept = run.samples(chosen)
        x = _with_offsets(kept if not run.varies else run, model, chosen)
        if not (np.isfinite(x).all() and np.isfinite(central.y_m).all()):
            raise ValueError(f"what is said of run {run.name} without it has values that are not finite")
        x[_SIDE] = central.x_m[0, chosen]
        y_error = np.abs(central.y_m[0, chosen] - kept.y_m)
        return cls(run, Meeting.of_run(run, central), x, kept.x_m, y_error, kept.time_s)

    @property
    def central_m(self) -> Array:
        """x (time,) without an offset."""
        return np.asarray(self.x_m[_SIDE])

    def speed_at(self, settled_s: float) -> float:
        """Settled speed (m/s) of a constant run as the model has it."""
        seen = np.interp(look_times(settled_s), self.time_s, self.central_m)
        return float(settled_speed(seen[None], settled_s)[0])

    def scores(self, scale: float) -> Array:
        """Of each time after the first: the least factor of the scale with which the band holds the run."""
        offsets = np.minimum(FACTORS * scale * UNIT_OFFSET, LARGEST_ERROR)
        centre = self.central_m
        room = FACTORS[:, None] * (scale * remainder_m(self.time_s, centre - centre[0]))
        low = np.minimum(self._at(offsets), centre) - room
        high = np.maximum(self._at(-offsets), centre) + room
        out = np.maximum(low - self.true_x_m, self.true_x_m - high)[:, 1:]  # not above zero: inside
        first = np.where((out <= 0).any(axis=0), (out <= 0).argmax(axis=0), len(FACTORS) - 1)
        before, every = np.maximum(first - 1, 0), np.arange(out.shape[1])
        gap = np.maximum(out[before, every], 0.0)
        rest = np.maximum(-out[first, every], 0.0)
        share = np.where(gap + rest > 0, gap / np.maximum(gap + rest, 1e-300), 0.0)
        return np.asarray(FACTORS[before] + share * (FACTORS[first] - FACTORS[before]))

    def half_width(self, factor: float, scale: float) -> Array:
        """Of the band with this factor, (time,), m."""
        offset = np.array([min(factor * scale * UNIT_OFFSET, LARGEST_ERROR)])
        low, high = (np.minimum(self._at(offset)[0], self.central_m), np.maximum(self._at(-offset)[0], self.central_m))
        room = factor * scale * remainder_m(self.time_s, self.central_m - self.central_m[0])
        return np.asarray(0.5 * (high - low) + room)

    def typical_score(self) -> float:
        """At a scale of one, what four fifths of the times stay below."""
        return float(np.quantile(self.scores(1.0), 0.8))

    def true_class(self) -> int:
        """What the run did."""
        end = self.true_x_m[-1:] - self.true_x_m[0]
        return int(classes(mean_speed(self.true_x_m[None], self.time_s, self.late()), end)[0])

    def borders(self) -> tuple[float, float, float]:
        """The offsets from which on the model's rover no longer goes up, ends below its start, and slides."""
        speeds = np.minimum.accumulate(mean_speed(self.x_m, self.time_s, self.late()))
        ends = np.minimum.accumulate(self.x_m[:, -1] - self.x_m[:, 0])
        return _crossing(speeds, LATE_SPEED_M_S), _crossing(ends, 0.0), _crossing(speeds, -LATE_SPEED_M_S)

    def late(self) -> Array:
        """Share of each interval between times that counts for how the run ends, (time - 1,)."""
        driven = np.interp(self.time_s, self.run.time_s, self.meeting.driven.astype(np.float64)) > 0.5
        return late_part(self.time_s, driven)

    def reserve(self) -> float:
        """The offset (fraction of the weight) from which on the rover no longer climbs; within +-MOST_OFFSET."""
        return float(np.clip(self.borders()[0], -MOST_OFFSET, MOST_OFFSET))

    def _at(self, offsets: Array) -> Array:
        rows = np.clip(np.searchsorted(OFFSETS, offsets) - 1, 0, len(OFFSETS) - 2)
        share = ((offsets - OFFSETS[rows]) / (OFFSETS[rows + 1] - OFFSETS[rows]))[:, None]
        return np.asarray(self.x_m[rows] * (1.0 - share) + self.x_m[rows + 1] * share)


def excursions(runs: Sequence[ObservedRun], models: Mapping[str, OffsetModel]) -> list[Excursion]:
    """Of each run, with the model that has not seen it. Raises ValueError when one is missing."""
    missing = [run.name for run in runs if run.name not in models]
    if missing:
        raise ValueError(f"run {missing[0]} has no model without it")
    return [Excursion.of(run, models[run.name]) for run in runs]


def late_part(time_s: Array, driven: npt.NDArray[np.bool_]) -> Array:
    """Seconds of each interval that belong to the last quarter of the whole time, (time - 1,).

    Only time in which motors drive counts, as far back as needed; all of it where they never do.
    """
    steps, drives = time_s[1:] - time_s[:-1], driven[:-1]
    counts = steps if drives.all() or not drives.any() else np.where(drives, steps, 0.0)
    wanted = 0.25 * (time_s[-1] - time_s[0])
    after = counts[::-1].cumsum()[::-1] - counts  # of what counts, later than this interval
    return np.asarray(np.minimum(np.maximum(wanted - after, 0.0), counts))


def mean_speed(x_m: Array, time_s: Array, seconds: Array) -> Array:
    """Mean speeds (...,) of x (..., time) over the given seconds of each interval."""
    speed = np.diff(x_m, axis=-1) / np.maximum(np.diff(time_s), 1e-12)
    return np.asarray((speed * seconds).sum(axis=-1) / max(float(seconds.sum()), 1e-12))


def _crossing(falling: Array, border: float) -> float:
    """The offset at which falling values (offset,) come below the border; infinite where none, or all, do."""
    below = falling < border
    if below.all() or not below.any():
        return -np.inf if below.all() else np.inf
    first = int(below.argmax())
    high, low = float(falling[first - 1]), float(falling[first])
    share = (high - border) / max(high - low, 1e-12)
    return float(OFFSETS[first - 1] + share * (OFFSETS[first] - OFFSETS[first - 1]))


def _with_offsets(run: ObservedRun, model: OffsetModel, chosen: npt.NDArray[np.intp]) -> Array:
    """x (offset, chosen time); of a constant run, which has only these times, all at once."""
    if run.varies:
        found: list[Positions] = [model.drive_run(run, float(offset)) for offset in OFFSETS]
        return np.stack([each.x_m[0, chosen] for each in found])
    count = len(OFFSETS)
    same = Scenarios.stack([run.scenario] * count)
    return np.array(model.positions_with(same, run.time_s, OFFSETS).x_m)
