"""How each architecture comes from runs to a model. Adding an architecture means adding a function here."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from service.learning.left_out import left_out_slopes
from service.learning.network.fit import EpochCallback, FitOutcome, fit
from service.learning.network.fit_state import FitState
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import make_residual
from service.learning.network.rows import Rows, rows_of
from service.learning.observed import ObservedRun, scenarios_of
from service.learning.resistance.fit import fit_resistance_process
from service.learning.split import training_samples, validation_samples
from service.learning.trajectory_model import TrajectoryModel
from service.physics.prior import Prior
from service.physics.scenario import Positions
from service.training.config import TrainingConfig
from service.training.data import TrainingData


@dataclass(frozen=True, slots=True)
class Fitted:
    """A fitted model. `left_out` holds, by run, what the model says of it when that very run is left out of the fit,
    and `left_out_slopes` what it says when fitted to nothing but the other slopes of that run's series (see
    `service.learning.left_out`). Both are empty for architectures where that would mean fitting once for each run.
    """

    model: TrajectoryModel
    outcome: FitOutcome
    left_out: Mapping[str, Positions]
    left_out_slopes: Mapping[str, Positions]


@dataclass(frozen=True, slots=True)
class NetworkRows:
    """What a network is fitted to. Costs seconds for many samples, so those who fit in pieces keep it."""

    signature: InputSignature
    train: Rows
    validation: Rows


@dataclass(frozen=True, slots=True)
class Callbacks:
    """How a fit tells where it stands, and from where it goes on; `rows` are those of an earlier piece of it.

    `check` is called every second or so of a fit without epochs, and may raise to stop it.
    """

    announce: Callable[[str], None]
    on_epoch: EpochCallback | None = None
    resume: FitState | None = None
    rows: NetworkRows | None = None
    check: Callable[[], None] = lambda: None


def fit_architecture(
    config: TrainingConfig, runs: Sequence[ObservedRun], data: TrainingData, prior: Prior, callbacks: Callbacks
) -> Fitted:
    """Fit the architecture that the config names, on these runs alone, over the calibrated prior."""
    return _FITS[config.architecture](config, runs, data, prior, callbacks)


def network_rows(config: TrainingConfig, runs: Sequence[ObservedRun], data: TrainingData, prior: Prior) -> NetworkRows:
    """The rows and inputs of a network for these runs."""
    horizon = max(run.horizon_s for run in runs)
    signature = InputSignature.fitted(config.inputs, scenarios_of(runs), horizon, data.rover, data.regolith)
    return NetworkRows(
        signature,
        rows_of([training_samples(run) for run in runs], prior, signature),
        rows_of([validation_samples(run) for run in runs], prior, signature),
    )


def _fit_network(
    config: TrainingConfig, runs: Sequence[ObservedRun], data: TrainingData, prior: Prior, callbacks: Callbacks
) -> Fitted:
    rows = callbacks.rows or network_rows(config, runs, data, prior)
    model = _fresh_network(config, prior, rows.signature, rows.train)
    outcome = fit(
        model.residual,
        rows.train,
        rows.validation,
        config.fit,
        on_epoch=callbacks.on_epoch,
        resume=callbacks.resume,
    )
    return Fitted(model, outcome, {}, {})


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
    fitted = fit_resistance_process(
        runs, data.rover, data.regolith, prior, progress=callbacks.announce, check=callbacks.check
    )
    squares = [
        np.mean((fitted.left_out[run.name].x_m[0] - run.x_m) ** 2 + (fitted.left_out[run.name].y_m[0] - run.y_m) ** 2)
        for run in runs
    ]

    def leave_one_out(series: Sequence[ObservedRun]) -> Mapping[str, Positions]:
        callbacks.announce(f"leaving out one slope at a time of {len(series)} with the same mass and torque")
        return fit_resistance_process(series, data.rover, data.regolith, prior, check=callbacks.check).left_out

    slopes = left_out_slopes(runs, leave_one_out)
    outcome = FitOutcome(0, 0, float(np.mean(squares)), False, time.monotonic() - started, "cpu")
    return Fitted(fitted.model, outcome, fitted.left_out, slopes)


_FITS: dict[str, Callable[[TrainingConfig, Sequence[ObservedRun], TrainingData, Prior, Callbacks], Fitted]] = {
    "paper_network": _fit_network,
    "zero": _fit_network,
    "resistance_process": _fit_resistance,
}
