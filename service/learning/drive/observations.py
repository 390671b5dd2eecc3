"""From recorded runs to what the fit compares a law with: track, controls, positions and wheel speeds at some times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from service.learning.drive.recorded import controls_of, start_speed, track_of
from service.learning.drive.sweep import SweptRun
from service.learning.observed import ObservedRun
from service.physics.parameters import RoverParameters
from service.physics.scenario import Array

STEP_S = 0.05  # runs are resampled to this step: about a grouser's passage
_INTERVALS, _LONG_INTERVALS, _LONG_S = 40, 60, 10.5  # times at which a run is compared; more of those that last longer
_SPEED_SMOOTHING, _WHEEL_SMOOTHING = 2.0, 4.0  # in steps
_WHEELS_FROM_S, _WHEEL_LEAST_RAD_S = 0.4, 0.05
# What is left between a good law and a run, as fractions of the way (half a metre at least): where it climbs, and near
# stalling or sliding, where small differences grow.
_USUAL_ERROR, _HARD_ERROR, _LEAST_WAY_M = 0.003, 0.012, 0.5
_SLIDES_BELOW_M, _HARDLY_CLIMBS_M = -0.25, 0.5
_FORCED_ERROR_M, _FORCED_ERROR = 0.004, 0.006
FORCED_INTERVALS = 4
WHEEL_ERROR_RAD_S = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """One run for the fit. Arrays of shape (time,): positions (m) and, front and rear, wheel speeds (rad/s), smoothed.

    `error_m` is how far off a good law may be when it drives the whole run, `forced_error_m` (time,) when it is set
    back on the run every `FORCED_INTERVALS` times. `wheels_count` says where the wheel speeds are comparable.
    """

    swept: SweptRun
    wheels_rad_s: Array  # (2, time)
    wheels_count: Array  # (time,) of 0 and 1
    error_m: float
    forced_error_m: Array


def observe(run: ObservedRun, rover: RoverParameters) -> Observation:
    """What the fit needs of a run. Raises ValueError for a run that is shorter than a tenth of a second."""
    if run.horizon_s < 2 * STEP_S:
        raise ValueError(f"run {run.name} lasts {run.horizon_s} s, it must last {2 * STEP_S} s at least")
    grid = np.linspace(0.0, run.horizon_s, round(run.horizon_s / STEP_S) + 1)
    x = np.interp(grid, run.time_s, run.x_m - run.x_m[0])
    speed = gaussian_filter1d(np.gradient(x, grid), _SPEED_SMOOTHING, mode="nearest")
    intervals = _INTERVALS if run.horizon_s < _LONG_S else _LONG_INTERVALS
    chosen = np.unique(np.linspace(0, len(grid) - 1, intervals + 1).round().astype(int))
    wheels = np.stack([_wheel(run, grid, each) for each in (run.front_wheel_speed_rad_s, run.rear_wheel_speed_rad_s)])
    driven = np.interp(grid, run.time_s, np.where(run.brakes, 0.0, run.torques_nm)) > 0
    comparable = driven & (grid > _WHEELS_FROM_S) & np.isfinite(wheels).all(axis=0)
    comparable &= (np.abs(wheels) > _WHEEL_LEAST_RAD_S).all(axis=0)
    swept = SweptRun(
        run.mass_kg, start_speed(run), track_of(run, rover), controls_of(run), grid[chosen], x[chosen], speed[chosen]
    )
    way = max(_LEAST_WAY_M, float(np.abs(np.diff(x)).sum()))
    hard = x.min() < _SLIDES_BELOW_M or x[-1] < _HARDLY_CLIMBS_M
    return Observation(
        swept,
        np.nan_to_num(wheels[:, chosen]),
        comparable[chosen].astype(np.float64),
        (_HARD_ERROR if hard else _USUAL_ERROR) * way,
        _forced_error(x[chosen]),
    )


def observe_all(runs: Sequence[ObservedRun], rover: RoverParameters) -> list[Observation]:
    """`observe` for each."""
    return [observe(run, rover) for run in runs]


def _wheel(run: ObservedRun, grid: Array, speed_rad_s: Array | None) -> Array:
    """Smoothed means over the grid's steps, (time,); NaN where nothing was recorded."""
    if speed_rad_s is None:
        return np.full(len(grid), np.nan)
    turned = np.concatenate([[0.0], np.cumsum(np.diff(run.time_s) * 0.5 * (speed_rad_s[1:] + speed_rad_s[:-1]))])
    means = np.diff(np.interp(grid, run.time_s, turned)) / np.diff(grid)
    return np.concatenate([[0.0], gaussian_filter1d(means, _WHEEL_SMOOTHING, mode="nearest")])


def _forced_error(x_m: Array) -> Array:
    moved = np.zeros(len(x_m))
    moved[FORCED_INTERVALS:] = np.abs(x_m[FORCED_INTERVALS:] - x_m[:-FORCED_INTERVALS])
    return np.asarray(_FORCED_ERROR_M + _FORCED_ERROR * moved)
