"""Errors in metres of a model on runs, always beside those of its prior alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from service.learning.observed import ObservedRun, require_constant
from service.learning.trajectory_model import TrajectoryModel
from service.physics.prior import Prior
from service.physics.scenario import Positions


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
    """One run: what it was, how far it went, and the errors of the model and of its prior alone."""

    run: str
    set_name: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    final_x_m: float
    model: PositionErrors
    prior: PositionErrors


def evaluate(model: TrajectoryModel, runs: Sequence[ObservedRun]) -> list[RunEvaluation]:
    """Errors of the model on each run, at the run's own times. Raises TrainingError for runs whose slope, torque or
    brake change.
    """
    require_constant(runs)
    return [_evaluate_run(model.prior, run, model.positions(run.scenario, run.time_s)) for run in runs]


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
        model=PositionErrors.between(predicted, run),
        prior=PositionErrors.between(prior.positions(run.scenario, run.time_s), run),
    )


_SUMMARISED = ("final_m", "maximum_m", "rmse_m", "rmse_x_m", "rmse_y_m")


def summarise(evaluations: Sequence[RunEvaluation]) -> dict[str, Any]:
    """Median, 90th percentile and maximum over the runs of each error, for the model and for the prior alone.

    JSON values; with no runs only their count.
    """
    summary: dict[str, Any] = {"runs": len(evaluations)}
    for side in ("model", "prior") if evaluations else ():
        summary[side] = {}
        for name in _SUMMARISED:
            values = np.array([getattr(getattr(each, side), name) for each in evaluations])
            summary[side][name] = {
                "median": float(np.median(values)),
                "p90": float(np.quantile(values, 0.9)),
                "maximum": float(values.max()),
            }
    return summary


def describe_evaluation(evaluations: Sequence[RunEvaluation]) -> dict[str, Any]:
    """Summary and every run, as JSON values."""
    return {"summary": summarise(evaluations), "by_run": [asdict(each) for each in evaluations]}
