"""Fitting a law to whole runs: damped Gauss-Newton steps on what is driven, with a pull towards the priors.

Whole drives are compared, not accelerations: hidden states (ruts, digging) need no measuring, and what counts in the
end is what is made small. Derivatives are differences of drives, a few thousand in a second. First each run is set
back on its course every second, which is nearly convex; then runs are driven whole. Runs that no law of this form can
follow (a rover that leaves its ruts) lose influence by a Cauchy loss over runs: Hampel and others, Robust Statistics,
1986.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from service.learning.drive.law import PARAMETERS, Law
from service.learning.drive.observations import FORCED_INTERVALS, WHEEL_ERROR_RAD_S, Observation
from service.learning.drive.priors import Whitening, fitted_parameters, parameters_of
from service.learning.drive.sweep import Sweep
from service.physics.scenario import Array

_DIFFERENCE = 1e-3  # in prior deviations
_INDEPENDENT = 8.0  # independent observations in a run; its many points are not
_ROBUST = 3.0  # in expected errors: from here on a run counts less and less
_WHEEL_SHARE = 0.4
_WHEEL_MOST = 4.0
_MOST_ROW, _MOST_WHEEL_ROW = 3e3, 3e2  # where a run tips over its derivative means nothing
_MOST_STEP = 3.0
_DAMPINGS = (0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
_LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e5
_FINISHED = 0.002  # relative fall of the cost
_FAR = 1e6
# Of the step that leaves a run out: about the damping of a fit's last steps. Without it, and with steps of several
# prior deviations, a few runs blow up that fits without them predict well. Both were set after seeing that, so left-out
# errors flatter: docs/fidelity.md has folds that were fitted anew.
_LEFT_OUT_DAMPING, _LEFT_OUT_STEP = 0.1, 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Normal:
    """Weighed residuals of positions and wheels, and their derivatives: rows of the normal equations."""

    rows: Array  # (point, number)
    residual: Array  # (point,)
    wheel_rows: Array  # (2 point, number)
    wheel_residual: Array  # (2 point,)


@dataclass(frozen=True, slots=True, eq=False)
class _Driven:
    x_m: Array
    wheels_rad_s: Array
    cost: float
    squares: Array  # mean squared error of each run, in expected errors


class Problem:
    """Runs and a form of the law. Numbers `y` are all standard normal beforehand: parameters, then weights."""

    def __init__(
        self, law: Law, whitening: Whitening, observed: Sequence[Observation], threads: int, forced: bool = False
    ) -> None:
        self._whitening, self._threads, self._observed = whitening, threads, observed
        self.free = np.concatenate([fitted_parameters(), len(PARAMETERS) + np.arange(law.weight_count)])
        self.size = len(PARAMETERS) + law.weight_count
        self._sweep = Sweep(law, [each.swept for each in observed], FORCED_INTERVALS if forced else 0)
        self.starts = self._sweep.offsets
        counts = np.diff(self.starts)
        self._x = np.concatenate([each.swept.observed_x_m for each in observed])
        self._wheels = np.concatenate([each.wheels_rad_s for each in observed], axis=1).ravel()
        expected = (
            each.forced_error_m if forced else np.full(len(each.forced_error_m), each.error_m) for each in observed
        )
        self._error = np.concatenate(list(expected))
        self._share = np.repeat(np.sqrt(_INDEPENDENT / counts), counts)
        comparable = np.concatenate([each.wheels_count for each in observed])
        self._wheel_share = np.tile(self._share * comparable, 2) * _WHEEL_SHARE / WHEEL_ERROR_RAD_S

    def numbers(self, y: Array) -> tuple[Array, Array]:
        """Parameters and weights, both (row, ...), of standard-normal numbers (row, size)."""
        count = len(PARAMETERS)
        return parameters_of(y[:, :count]), self._whitening.weights_of(y[:, count:])

    def drive(self, y: Array) -> tuple[Array, Array]:
        """x (row, point) and wheel speeds (row, 2 point) of rows of numbers."""
        x, _, front, rear = self._sweep(*self.numbers(y), threads=self._threads)
        return x, np.concatenate([front, rear], axis=1)

    def judge(self, y: Array) -> list[_Driven]:
        """What each row of numbers makes of the runs, and its cost."""
        found = []
        for x, wheels, row in zip(*self.drive(y), y, strict=True):
            error = np.clip(np.nan_to_num((x - self._x) / self._error, nan=_FAR), -_FAR, _FAR)
            squares = np.add.reduceat(np.square(error), self.starts[:-1]) / np.diff(self.starts)
            apart = self._wheel_share * (wheels - self._wheels)
            most = _WHEEL_MOST * WHEEL_ERROR_RAD_S * self._wheel_share
            wheel_cost = np.square(np.clip(apart, -most, most)).sum()
            robust = _INDEPENDENT * _ROBUST**2 * np.log1p(squares / _ROBUST**2).sum()
            cost = float(robust + wheel_cost + np.square(row[self.free]).sum())
            found.append(_Driven(x, wheels, cost, squares))
        return found

    def normal(self, y: Array, driven: _Driven) -> Normal:
        """The weighed, linearised problem at y."""
        moved = np.repeat(y[None], len(self.free), axis=0)
        moved[np.arange(len(self.free)), self.free] += _DIFFERENCE
        x, wheels = self.drive(moved)
        influence = 1.0 / np.sqrt(1.0 + driven.squares / _ROBUST**2)
        share = self._share / self._error * np.repeat(influence, np.diff(self.starts))
        slope = (x - driven.x_m).T / _DIFFERENCE * share[:, None]
        apart = driven.wheels_rad_s - self._wheels
        near = self._wheel_share * (np.abs(apart) < _WHEEL_MOST * WHEEL_ERROR_RAD_S)
        wheel_slope = (wheels - driven.wheels_rad_s).T / _DIFFERENCE * near[:, None]
        return Normal(
            np.nan_to_num(np.clip(slope, -_MOST_ROW, _MOST_ROW)),
            -(driven.x_m - self._x) * share,
            np.nan_to_num(np.clip(wheel_slope, -_MOST_WHEEL_ROW, _MOST_WHEEL_ROW)),
            -apart * near,
        )

    def equations(self, y: Array, normal: Normal) -> tuple[Array, Array]:
        """Matrix and right-hand side for the next step, the priors' pull included."""
        matrix = normal.rows.T @ normal.rows + normal.wheel_rows.T @ normal.wheel_rows + np.eye(len(self.free))
        side = normal.rows.T @ normal.residual + normal.wheel_rows.T @ normal.wheel_residual - y[self.free]
        return matrix, side


def minimise(
    problem: Problem, y: Array, most_steps: int, tell: Callable[[int, float], None] = lambda _step, _cost: None
) -> Array:
    """Numbers of least cost from y on. `tell` hears of each step and its cost before it is taken, and may raise."""
    at, damping, size = problem.judge(y[None])[0], 0.3, len(problem.free)
    step = 0
    while step < most_steps and damping <= _MOST_DAMPING:
        tell(step, at.cost)
        matrix, side = problem.equations(y, problem.normal(y, at))
        while damping <= _MOST_DAMPING:
            dampings = damping * np.array(_DAMPINGS)
            tried = np.repeat(y[None], len(dampings), axis=0)
            for row, each in zip(tried, dampings, strict=True):
                damped = matrix + each * (np.eye(size) + 0.02 * np.diag(np.diag(matrix)))
                row[problem.free] += np.clip(np.linalg.solve(damped, side), -_MOST_STEP, _MOST_STEP)
            judged = problem.judge(tried)
            best = int(np.argmin([each.cost for each in judged]))
            if judged[best].cost < at.cost:
                break
            damping *= 100.0
        else:
            break
        finished = at.cost - judged[best].cost < _FINISHED * at.cost
        y, at, damping = tried[best], judged[best], max(float(dampings[best]), _LEAST_DAMPING)
        step += 1
        if finished:
            break
    return y


def without_each(problem: Problem, y: Array) -> Array:
    """For each run the numbers as if fitted without it, (run, size): one Gauss-Newton step from y.

    The run's rows are taken out of the equations at y (block form of the leave-one-out formula, Rasmussen and Williams,
    Gaussian Processes for Machine Learning, section 5.4.2). y counts as the optimum, though the fit stopped a little
    before it: what is left of the way there is no error of leaving out. Against folds that were fitted anew:
    docs/fidelity.md.
    """
    normal = problem.normal(y, problem.judge(y[None])[0])
    matrix, _ = problem.equations(y, normal)
    points, found = int(problem.starts[-1]), []
    for start, end in zip(problem.starts[:-1], problem.starts[1:], strict=True):
        own = normal.rows[start:end]
        wheels = np.concatenate([np.arange(start, end), np.arange(points + start, points + end)])
        own_wheels = normal.wheel_rows[wheels]
        less = matrix - own.T @ own - own_wheels.T @ own_wheels
        less += _LEFT_OUT_DAMPING * (np.eye(len(less)) + 0.02 * np.diag(np.diag(matrix)))
        pull = own.T @ normal.residual[start:end] + own_wheels.T @ normal.wheel_residual[wheels]
        moved = y.copy()
        moved[problem.free] -= np.clip(np.linalg.solve(less, pull), -_LEFT_OUT_STEP, _LEFT_OUT_STEP)
        found.append(moved)
    return np.array(found)
