"""Errors in metres of a model on runs, always beside those of its prior alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from service.learning.observed import ObservedRun, require_constant
from service.learning.trajectory_model import DrivesRuns, TrajectoryModel
from service.physics.prior import Prior
from service.physics.scenario import Positions

LEAST_WAY_M = 0.5
"""Relative errors are over the way that the rover went, or over this where it went less."""
_WAY_STEP_S = 0.05  # about a grouser's passage: shorter movements are vibration, no way


@dataclass(frozen=True, slots=True)
class PositionErrors:
    """Distances (m) between predicted and simulated wheel positions over one run; x along, y normal to the slope."""

    final_m: float
    maximum_m: float
    rmse_m: float
    final_x_m: float
    final_y_m: float
    maximum_x_m: float
    maximum_y_m: float
    rmse_x_m: float
    rmse_y_m: float

    @classmethod
    def between(cls, predicted: Positions, run: ObservedRun) -> Self:
        """Errors of one scenario's positions, of shape (1, time), at the run's own times."""
        dx, dy = predicted.x_m[0] - run.x_m, predicted.y_m[0] - run.y_m
        distance = np.hypot(dx, dy)
        return cls(
            final_m=float(distance[-1]),
            maximum_m=float(distance.max()),
            rmse_m=float(np.sqrt(np.mean(distance**2))),
            final_x_m=float(abs(dx[-1])),
            final_y_m=float(abs(dy[-1])),
            maximum_x_m=float(abs(dx).max()),
            maximum_y_m=float(abs(dy).max()),
            rmse_x_m=float(np.sqrt(np.mean(dx**2))),
            rmse_y_m=float(np.sqrt(np.mean(dy**2))),
        )


@dataclass(frozen=True, slots=True)
class RunEvaluation:
    """One run: what it was, how far it went, and the errors of the model and of its prior alone.

    Slope and torque of a run that `varies` are those at its start; a prior has no answer there, and `prior` is None.
    `way_m` is how far the rover went, up and down, `final_x_m` where it ended.
    """

    run: str
    set_name: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    final_x_m: float
    way_m: float
    varies: bool
    model: PositionErrors
    prior: PositionErrors | None

    @property
    def relative_final(self) -> float:
        """Final error over the way that the rover went, or over `LEAST_WAY_M` where it went less; dimensionless."""
        return self.model.final_m / max(self.way_m, LEAST_WAY_M)

    @property
    def relative_maximum(self) -> float:
        """The same for the largest error on the way."""
        return self.model.maximum_m / max(self.way_m, LEAST_WAY_M)


def evaluate(model: TrajectoryModel, runs: Sequence[ObservedRun]) -> list[RunEvaluation]:
    """Errors of the model on each run, at the run's own times.

    Raises TrainingError for runs whose slope, torque or brake change, if the model does not know such runs.
    """
    if not isinstance(model, DrivesRuns):
        require_constant(runs)
    return [_evaluate_run(model.prior, run, predict_run(model, run)) for run in runs]


def predict_run(model: TrajectoryModel, run: ObservedRun) -> Positions:
    """What the model says of a run, shape (1, time) at its times. Raises TrainingError as `evaluate` does."""
    if run.varies and isinstance(model, DrivesRuns):
        return model.drive_run(run)
    require_constant([run])
    return model.positions(run.scenario, run.time_s)


def evaluate_positions(
    prior: Prior, runs: Sequence[ObservedRun], positions: Mapping[str, Positions]
) -> list[RunEvaluation]:
    """Errors of positions that were predicted elsewhere, by run name, each of shape (1, time) at the run's times."""
    return [_evaluate_run(prior, run, positions[run.name]) for run in runs]


def _evaluate_run(prior: Prior, run: ObservedRun, predicted: Positions) -> RunEvaluation:
    return RunEvaluation(
        run=run.name,
        set_name=run.set_name,
        slope_deg=run.slope_deg,
        mass_kg=run.mass_kg,
        torque_nm=run.torque_nm,
        horizon_s=run.horizon_s,
        final_x_m=float(run.x_m[-1]),
        way_m=way_m(run),
        varies=run.varies,
        model=PositionErrors.between(predicted, run),
        prior=None if run.varies else PositionErrors.between(prior.positions(run.scenario, run.time_s), run),
    )


def way_m(run: ObservedRun) -> float:
    """How far the rover went along the surface, uphill and downhill, m."""
    steps = max(1, round(run.horizon_s / _WAY_STEP_S))
    return float(np.abs(np.diff(np.interp(np.linspace(0.0, run.horizon_s, steps + 1), run.time_s, run.x_m))).sum())


_SUMMARISED = ("final_m", "maximum_m", "rmse_m", "rmse_x_m", "rmse_y_m")


def summarise(evaluations: Sequence[RunEvaluation]) -> dict[str, Any]:
    """Median, 90th percentile and maximum over the runs of each error, for the model and for the prior alone.

    The prior's are over the runs that it has an answer for. `relative` has the model's final and largest errors over
    the way. JSON values; with no runs only their count, and no prior where it has no answer at all.
    """
    summary: dict[str, Any] = {"runs": len(evaluations)}
    sides = {
        "model": [each.model for each in evaluations],
        "prior": [each.prior for each in evaluations if each.prior is not None],
    }
    for side, errors in sides.items():
        if errors:
            summary[side] = {name: _spread([getattr(each, name) for each in errors]) for name in _SUMMARISED}
    if evaluations:
        final, maximum = ([getattr(each, f"relative_{name}") for each in evaluations] for name in ("final", "maximum"))
        summary["relative"] = {"final": _spread(final), "maximum": _spread(maximum)}
    return summary


def _spread(values: Sequence[float]) -> dict[str, float]:
    return {
        "median": float(np.median(values)),
        "p90": float(np.quantile(values, 0.9)),
        "maximum": float(np.max(values)),
    }


def describe_evaluation(evaluations: Sequence[RunEvaluation]) -> dict[str, Any]:
    """Summary and every run, as JSON values."""
    return {"summary": summarise(evaluations), "by_run": [asdict(each) for each in evaluations]}
