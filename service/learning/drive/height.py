"""How high the rear wheel's centre stands above the undeformed surface: linear in numbers that the state gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from service.learning.drive.engine import Engine
from service.learning.drive.observations import Observation
from service.learning.observed import ObservedRun
from service.physics.scenario import Array

_RIDGE = 1e-4


def fit_heights(engine: Engine, runs: Sequence[ObservedRun], observed: Sequence[Observation]) -> Array:
    """The law's `heights`, by least squares over all runs, each weighing the same.

    The state is what the engine makes of each run's inputs, so heights of a run that it does not follow are read at
    other states than the run's. Models that leave a run out keep these numbers, which have seen its heights.
    """
    rows, heights = [], []
    for run, seen in zip(runs, observed, strict=True):
        times = seen.swept.time_s
        start = engine.start(seen.swept.mass_kg, seen.swept.start_speed_m_s)
        features = engine.height_features(start, seen.swept.track, seen.swept.controls, times)
        share = 1.0 / np.sqrt(len(times))
        rows.append(features * share)
        heights.append(np.interp(times, run.time_s, run.y_m) * share)
    matrix, side = np.concatenate(rows), np.concatenate(heights)
    scale = np.maximum(np.sqrt(np.square(matrix).mean(axis=0)), 1e-9)
    scaled = matrix / scale
    normal = scaled.T @ scaled + _RIDGE * np.eye(scaled.shape[1])
    return np.asarray(np.linalg.solve(normal, scaled.T @ side) / scale)
