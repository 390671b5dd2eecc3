"""Left-out predictions: one slope without its series' run there, and errors over time, the raw material of the band."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from service.learning.observed import ObservedRun, scenarios_of
from service.physics.scenario import Array, Positions, Scenarios

CURVE_POINTS = 81  # an eighth of a second for runs of 10 s: errors grow smoothly, and linearly between two points
LOOK_POINTS = 20  # times at which the band looks how far back a rover is sent: it takes seconds to turn round

# From runs to what is predicted of each, by name, when only the others of them are known.
LeaveOneOut = Callable[[Sequence[ObservedRun]], Mapping[str, Positions]]


def left_out_slopes(runs: Sequence[ObservedRun], leave_one_out: LeaveOneOut, fewest: int = 5) -> dict[str, Positions]:
    """By run name what the other slopes of its own series, and nothing else, say of a run.

    A series is the runs of one set with one mass and one torque, at `fewest` different slopes at least; of several
    runs at one slope the first counts alone, so that none is predicted from its twin. Runs of no series are left out.
    """
    series: dict[tuple[str, float, float], dict[float, ObservedRun]] = {}
    for run in runs:
        slopes = series.setdefault((run.set_name, run.mass_kg, run.torque_nm), {})
        slopes.setdefault(run.slope_deg, run)
    predicted: dict[str, Positions] = {}
    for slopes in series.values():
        if len(slopes) >= fewest:
            predicted |= leave_one_out(list(slopes.values()))
    return predicted


@dataclass(frozen=True, slots=True, eq=False)
class LeftOutErrors:
    """Absolute errors (m) of each run's left-out prediction on a common time grid.

    `time_s` has shape (time,), `error_m` shape (2, run, time) for x and y, NaN beyond a run's own horizon, and
    `envelope_m` likewise: the largest error so far, which for a run that ended early stays at its last.
    `reach_m` of shape (run,) is the x that was predicted for `reach_time_s`, the shortest run's horizon, `lowest_m`
    the lowest x that was predicted for the start and `look_times(reach_time_s)`: zero or less.
    """

    scenarios: Scenarios
    time_s: Array
    error_m: Array
    envelope_m: Array
    reach_time_s: float
    reach_m: Array
    lowest_m: Array

    @classmethod
    def of(cls, runs: Sequence[ObservedRun], left_out: Mapping[str, Positions]) -> Self:
        """The curves of runs, given for each run's name the positions (1, time) predicted without it at its times.

        Raises ValueError when a prediction is missing, of another shape or not finite.
        """
        time = np.linspace(0.0, max(run.horizon_s for run in runs), CURVE_POINTS)
        reach_time = min(run.horizon_s for run in runs)
        error, envelope = np.empty((2, 2, len(runs), CURVE_POINTS))
        reach, lowest = np.empty((2, len(runs)))
        for row, run in enumerate(runs):
            predicted = _checked(run, left_out)
            seen = np.interp(look_times(reach_time), run.time_s, predicted.x_m[0])
            reach[row], lowest[row] = seen[-1], min(float(seen.min()), 0.0)
            pairs = ((predicted.x_m[0], run.x_m), (predicted.y_m[0], run.y_m))
            for axis, (there, true) in enumerate(pairs):
                absolute = np.abs(there - true)
                error[axis, row] = np.interp(time, run.time_s, absolute, right=np.nan)
                envelope[axis, row] = np.interp(time, run.time_s, np.maximum.accumulate(absolute))
        return cls(scenarios_of(runs), time, error, envelope, reach_time, reach, lowest)


def look_times(reach_time_s: float) -> Array:
    """Evenly spaced times (s) after the start, the last of them the reach time; shape (LOOK_POINTS,)."""
    return np.linspace(0.0, reach_time_s, LOOK_POINTS + 1)[1:]


def _checked(run: ObservedRun, left_out: Mapping[str, Positions]) -> Positions:
    if run.name not in left_out:
        raise ValueError(f"run {run.name} has no left-out prediction")
    predicted = left_out[run.name]
    for name, values in (("x_m", predicted.x_m), ("y_m", predicted.y_m)):
        if values.shape != (1, len(run.time_s)):
            raise ValueError(
                f"left-out {name} of run {run.name} has shape {values.shape}, expected (1, {len(run.time_s)})"
            )
        if not np.isfinite(values).all():
            raise ValueError(f"left-out {name} of run {run.name} has values that are not finite")
    return predicted
