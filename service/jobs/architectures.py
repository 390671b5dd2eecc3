"""How each architecture comes from runs to a model. Adding an architecture means adding a function here."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from service.jobs.training_config import TrainingConfig
from service.jobs.training_data import TrainingData
from service.learning.fit import EpochCallback, FitOutcome, fit
from service.learning.fit_state import FitState
from service.learning.inputs import InputSignature
from service.learning.model import PhysicsInformedModel, TrajectoryModel
from service.learning.observed import ObservedRun, scenarios_of
from service.learning.residuals import make_residual
from service.learning.resistance.fit import fit_resistance_process
from service.learning.rows import Rows, rows_of
from service.learning.split import training_samples, validation_samples
from service.physics.prior import Prior
from service.physics.scenario import Positions


@dataclass(frozen=True, slots=True)
class Fitted:
    """A fitted model. `left_out` holds, by run, what the model says of it when that very run is left out of the fit;
    it is empty for architectures where that would mean fitting once for each run.
    """

    model: TrajectoryModel
    outcome: FitOutcome
    left_out: Mapping[str, Positions]


@dataclass(frozen=True, slots=True)
class Callbacks:
    """How a fit tells where it stands, and from where it goes on."""

    announce: Callable[[str], None]
    on_epoch: EpochCallback | None = None
    resume: FitState | None = None


def fit_architecture(
    config: TrainingConfig, runs: Sequence[ObservedRun], data: TrainingData, prior: Prior, callbacks: Callbacks
) -> Fitted:
    """Fit the architecture that the config names, on these runs alone, over the calibrated prior."""
    return _FITS[config.architecture](config, runs, data, prior, callbacks)


def _fit_network(
    config: TrainingConfig, runs: Sequence[ObservedRun], data: TrainingData, prior: Prior, callbacks: Callbacks
) -> Fitted:
    horizon = max(run.horizon_s for run in runs)
    signature = InputSignature.fitted(config.inputs, scenarios_of(runs), horizon, data.rover, data.regolith)
    train_rows = rows_of([training_samples(run) for run in runs], prior, signature)
    validation_rows = rows_of([validation_samples(run) for run in runs], prior, signature)
    model = _fresh_network(config, prior, signature, train_rows)
    outcome = fit(
        model.residual,
        train_rows,
        validation_rows,
        config.fit,
        on_epoch=callbacks.on_epoch,
        resume=callbacks.resume,
    )
    return Fitted(model, outcome, {})


def _fresh_network(config: TrainingConfig, prior: Prior, signature: InputSignature, rows: Rows) -> PhysicsInformedModel:
    """A model with seeded random weights; its outputs are scaled by the spread of what they must explain."""
    torch.manual_seed(config.fit.seed)
    arguments: dict[str, Any] = {"input_count": len(signature.inputs)}
    if config.architecture == "paper_network":
        spread = rows.targets_m.std(dim=0).clamp(min=1e-4).tolist()
        arguments |= {"output_scale_m": spread, "x_form": config.x_form}
    return PhysicsInformedModel(prior, signature, make_residual(config.architecture, arguments))


def _fit_resistance(
    _config: TrainingConfig, runs: Sequence[ObservedRun], data: TrainingData, prior: Prior, callbacks: Callbacks
) -> Fitted:
    """Solved in one go: there are no epochs, and the validation loss is that of the left-out runs."""
    started = time.monotonic()
    fitted = fit_resistance_process(runs, data.rover, data.regolith, prior, progress=callbacks.announce)
    squares = [
        np.mean((fitted.left_out[run.name].x_m[0] - run.x_m) ** 2 + (fitted.left_out[run.name].y_m[0] - run.y_m) ** 2)
        for run in runs
    ]
    outcome = FitOutcome(0, 0, float(np.mean(squares)), False, time.monotonic() - started, "cpu")
    return Fitted(fitted.model, outcome, fitted.left_out)


_FITS: dict[str, Callable[[TrainingConfig, Sequence[ObservedRun], TrainingData, Prior, Callbacks], Fitted]] = {
    "paper_network": _fit_network,
    "zero": _fit_network,
    "resistance_process": _fit_resistance,
}
