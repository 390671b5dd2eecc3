"""The Gaussian process itself: covariance of all segments, solved once, and what leaving one run out does to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, cholesky
from scipy.linalg.lapack import dtrtri

from service.learning.resistance.hyperparameters import KernelHyperparameters
from service.learning.resistance.kernels import (
    ScenarioFeatures,
    ScenarioKernels,
    release_kernel,
    rut_plateau,
    scenario_kernels,
    stall_time_kernel,
    travel_kernel,
)
from service.learning.resistance.tables import TRAVEL_KNOTS_M, ResponseTables
from service.physics.scenario import Array

_JITTER = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class TrainingPoints:
    """Targets of all runs, run by run; arrays of shape (point,), `starts` of shape (run + 1,) says where runs begin.

    `speed_noise` is 1/(g dt), what an error of an end speed does to the target (0 where it does nothing); both noises
    are divided by `scale`.
    """

    starts: tuple[int, ...]
    duration_s: Array
    time_s: Array
    travel_m: Array
    target: Array
    speed_noise: Array
    scale: Array

    def of_run(self, run: int) -> slice:
        """Where the points of a run are."""
        return slice(self.starts[run], self.starts[run + 1])

    @property
    def run_count(self) -> int:
        """How many runs the points are from."""
        return len(self.starts) - 1


class SolvedProcess:
    """A process conditioned on its training points. `check` is called every second or so, and may raise to stop."""

    def __init__(
        self,
        hyper: KernelHyperparameters,
        features: ScenarioFeatures,
        points: TrainingPoints,
        time_knots_s: Array,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        self.points = points
        self._check = check
        # LAPACK works by columns: the transpose of the lower half, row by row, is an upper half without a copy.
        covariance = _covariance(hyper, features, points, check)
        upper = cholesky(covariance.T, lower=False, overwrite_a=True, check_finite=False)
        check()
        self._factor = upper
        self.weights: Array = cho_solve((upper, False), points.target, check_finite=False)
        self._travel = travel_kernel(hyper, TRAVEL_KNOTS_M, points.travel_m)
        self._release = release_kernel(hyper, time_knots_s, points.time_s)
        self._stall = stall_time_kernel(hyper, time_knots_s, points.time_s)
        self._plateau = rut_plateau(points.travel_m)

    def tables(self, weights: Array | None = None) -> ResponseTables:
        """The per-run tables of the solution, or of other weights."""
        weights = self.weights if weights is None else weights
        starts = list(self.points.starts[:-1])

        def summed(basis: Array) -> Array:
            return np.ascontiguousarray(np.add.reduceat(basis * weights, starts, axis=-1).T)

        return ResponseTables(
            summed(np.ones_like(weights)),
            summed(self._plateau),
            summed(self._travel),
            summed(self._release),
            summed(self._stall),
        )

    def left_out(self) -> Iterator[ResponseTables]:
        """For each run the tables as if the process had been solved without it.

        With B the run's points: weights - K^-1[:, B] (K^-1[B, B])^-1 weights[B], zero on B (block form of the
        leave-one-out formula, Rasmussen and Williams, Gaussian Processes for Machine Learning, section 5.4.2).
        """
        inverse, _ = dtrtri(self._factor, lower=0)
        self._check()
        count = self.points.run_count
        loads = np.zeros((len(self.weights), count))
        for run in range(count):
            inside = self.points.of_run(run)
            rows = np.triu(inverse[inside, inside.start :])
            loads[inside, run] = np.linalg.solve(rows @ rows.T, self.weights[inside])
        changes = cho_solve((self._factor, False), loads, overwrite_b=True, check_finite=False)
        self._check()
        for run in range(count):
            weights = self.weights - changes[:, run]
            weights[self.points.of_run(run)] = 0.0
            yield self.tables(weights)


def _covariance(
    hyper: KernelHyperparameters, features: ScenarioFeatures, points: TrainingPoints, check: Callable[[], None]
) -> Array:
    """Lower half of the covariance, built by rows of one run at a time so that the blocks stay small."""
    kernels = scenario_kernels(hyper, features, features)
    total = points.starts[-1]
    covariance = np.zeros((total, total))
    sizes = np.diff(points.starts)
    for run in range(points.run_count):
        rows, until = points.of_run(run), points.starts[run + 1]
        block = _between(hyper, kernels, points, rows, run, np.repeat(np.arange(run + 1), sizes[: run + 1]))
        block[:, rows] += _within(hyper, features, points, rows, run)
        covariance[rows, :until] = block
        check()
    return covariance


def _between(
    hyper: KernelHyperparameters, kernels: ScenarioKernels, points: TrainingPoints, rows: slice, run: int, other: Array
) -> Array:
    """Covariance of one run's points with those of all runs up to it; shape (row, column)."""
    columns = slice(0, len(other))
    time, travel = points.time_s, points.travel_m
    level, along, release, stall, rut = (kernel[run][other] for kernel in kernels)
    plateau = rut_plateau(travel)
    block = travel_kernel(hyper, travel[rows], travel[columns])
    block *= along
    block += level
    block += release * release_kernel(hyper, time[rows], time[columns])
    block += stall * stall_time_kernel(hyper, time[rows], time[columns])
    block += plateau[rows, None] * (rut * plateau[columns])
    return block


def _within(
    hyper: KernelHyperparameters, features: ScenarioFeatures, points: TrainingPoints, rows: slice, run: int
) -> Array:
    """What the points of one run share beyond their scenario, and their noise; shape (point, point)."""
    time, travel = points.time_s[rows], points.travel_m[rows]
    gate = float(features.gate[run])
    along, stalled = travel_kernel(hyper, travel, travel), stall_time_kernel(hyper, time, time)
    plateau = rut_plateau(travel)
    block = hyper.run_level_deviation**2 + (hyper.run_travel_deviation**2) * along
    block += hyper.run_release_deviation**2 * release_kernel(hyper, time, time)
    block += hyper.run_rut_deviation**2 * plateau[:, None] * plateau[None, :]
    block += (hyper.run_stall_deviation * gate) ** 2 * (along + stalled)
    block += hyper.speed_noise_m_s**2 * _difference_noise(points.speed_noise[rows] / points.scale[rows])
    mean_noise = hyper.noise_deviation**2 * (0.1 / points.duration_s[rows]) / points.scale[rows] ** 2
    block[np.diag_indices_from(block)] += mean_noise * (1.0 + (hyper.stall_noise_ratio * gate) ** 2) + _JITTER
    return np.asarray(block)


def _difference_noise(gain: Array) -> Array:
    """Covariance of differences of end speeds with independent errors: neighbours share one end. Unit error."""
    noise = np.diag(2.0 * gain**2)
    noise[0, 0] = 1.1 * gain[0] ** 2  # the speed at release is known better than others
    beside = -gain[1:] * gain[:-1]
    index = np.arange(len(beside))
    noise[index, index + 1] = noise[index + 1, index] = beside
    return noise
