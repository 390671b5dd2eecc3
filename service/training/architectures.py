"""How each architecture comes from runs to a model: a function and a row of the table for each."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from service.learning.doubt.meeting import OffsetModel
from service.learning.drive.fit import fit_drive
from service.learning.evaluate import PositionErrors
from service.learning.left_out import left_out_slopes
from service.learning.network.fit import FitOutcome, FitProgress, NetworkFit
from service.learning.network.fit_state import FitState
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import Residual, make_residual
from service.learning.network.rows import Rows, rows_of
from service.learning.observed import ObservedRun, scenarios_of
from service.learning.split import Split, training_samples, validation_samples
from service.learning.trajectory_model import TrajectoryModel
from service.physics.prior import Prior
from service.physics.scenario import Positions
from service.training.config import ArchitectureName, TrainingConfig
from service.training.data import TrainingData

Announce = Callable[[str], None]
Check = Callable[[], None]


@dataclass(frozen=True, slots=True)
class Prepared:
    """What a fit starts from: the data, its split, and the prior calibrated on the training runs."""

    config: TrainingConfig
    data: TrainingData
    split: Split
    prior: Prior


@dataclass(frozen=True, slots=True)
class Fitted:
    """A fitted model. `left_out` holds, by run, what the model says of it when that very run is left out of the fit,
    and `left_out_slopes` what it says when fitted to nothing but the other slopes of that run's series (see
    `service.learning.left_out`). Both are empty for architectures where that would mean fitting once for each run.
    `left_out_models` are those models, where their force balance can be made wrong: then there is a `Doubt`.
    """

    model: TrajectoryModel
    outcome: FitOutcome
    left_out: Mapping[str, Positions]
    left_out_slopes: Mapping[str, Positions]
    left_out_models: Mapping[str, OffsetModel] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Fitting:
    """A fit that has begun. `finish` makes the model, of the best epoch so far, at any time.

    `network` is None for an architecture without epochs: there `finish` solves for the model in one go.
    """

    finish: Callable[[], Fitted]
    network: NetworkFit | None = None

    @property
    def epoch(self) -> int:
        """How many epochs are finished."""
        return self.network.epoch if self.network else 0

    def epochs(self) -> Iterator[FitProgress]:
        """Fit the epochs that are left, telling after each where the fit stands. Raises TrainingError."""
        return self.network.epochs() if self.network else iter(())


def begin_fit(
    prepared: Prepared,
    resume: FitState | None = None,
    *,
    announce: Announce = lambda _phase: None,
    check: Check = lambda: None,
) -> Fitting:
    """Begin to fit the architecture that the config names, on the training runs alone, over the calibrated prior.

    With epochs it goes on from `resume`. Without, `announce` hears of the phases of `finish`, and `check` is called
    every second or so; both may raise to stop it.
    """
    return _BEGIN[prepared.config.architecture](prepared, resume, announce, check)


def _begin_drive(prepared: Prepared, _resume: FitState | None, announce: Announce, check: Check) -> Fitting:
    return Fitting(lambda: _fit_drive(prepared, announce, check))


def _begin_network(prepared: Prepared, resume: FitState | None, _announce: Announce, _check: Check) -> Fitting:
    config, data, prior, runs = prepared.config, prepared.data, prepared.prior, prepared.split.train
    horizon = max(run.horizon_s for run in runs)
    signature = InputSignature.fitted(config.inputs, scenarios_of(runs), horizon, data.rover, data.regolith)
    train = rows_of([training_samples(run) for run in runs], prior, signature)
    validation = rows_of([validation_samples(run) for run in runs], prior, signature)
    residual = _fresh_residual(config, train)
    fit = NetworkFit(residual, train, validation, config.fit, resume=resume)

    def finish() -> Fitted:
        outcome = fit.finish()
        return Fitted(PhysicsInformedModel(prior, signature, residual.correction()), outcome, {}, {})

    return Fitting(finish, fit)


_BEGIN: Mapping[ArchitectureName, Callable[[Prepared, FitState | None, Announce, Check], Fitting]] = {
    "drive_model": _begin_drive,
    "paper_network": _begin_network,
    "zero": _begin_network,
}


def _fresh_residual(config: TrainingConfig, rows: Rows) -> Residual:
    """One with seeded random weights; its outputs are scaled by the spread of what they must explain."""
    torch.manual_seed(config.fit.seed)
    arguments: dict[str, Any] = {"input_count": rows.inputs.shape[1]}
    if config.architecture == "paper_network":
        spread = rows.targets_m.std(dim=0).clamp(min=1e-4).tolist()
        arguments |= {"output_scale_m": spread, "x_form": config.x_form}
    return make_residual(config.architecture, arguments)


def _fit_drive(prepared: Prepared, announce: Announce, check: Check) -> Fitted:
    """Fitted in one go: there are no epochs, and the validation loss is that of the left-out runs."""
    started = time.monotonic()
    prior, runs, threads = prepared.prior, prepared.split.train, torch.get_num_threads()
    fitted = fit_drive(runs, prior, progress=announce, check=check, threads=threads)
    squares = [PositionErrors.between(fitted.left_out[run.name], run).rmse_m ** 2 for run in runs]

    def leave_one_out(series: Sequence[ObservedRun]) -> Mapping[str, Positions]:
        announce(f"leaving out one slope at a time of {len(series)} with the same mass and torque")
        return fit_drive(series, prior, check=check, threads=threads).left_out

    slopes = left_out_slopes([run for run in runs if not run.varies], leave_one_out)
    outcome = FitOutcome(0, 0, float(np.mean(squares)), False, time.monotonic() - started, "cpu")
    return Fitted(fitted.model, outcome, fitted.left_out, slopes, fitted.left_out_models)
