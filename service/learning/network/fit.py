"""Fitting a residual: one readable loop. Knows nothing of files, queues or HTTP."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch

from service.errors import TrainingError
from service.learning.network.fit_config import FitConfig, learning_rate_at
from service.learning.network.fit_state import FitState, load_optimiser, optimiser_tensors, weights_of
from service.learning.network.residuals import Residual
from service.learning.network.rows import Rows


@dataclass(frozen=True, slots=True)
class FitProgress:
    """Where a fit stands after an epoch. Losses are equation (4), m**2; `remaining_s` assumes no early stop."""

    epoch: int
    epochs: int
    train_loss_m2: float
    validation_loss_m2: float
    best_epoch: int
    elapsed_s: float
    remaining_s: float


@dataclass(frozen=True, slots=True)
class FitOutcome:
    """How a fit ended; the residual that was passed in holds the averaged weights of `best_epoch`."""

    epochs: int
    best_epoch: int
    validation_loss_m2: float
    stopped_early: bool
    elapsed_s: float
    device: str


# Called after each epoch with where the fit stands; calling the second argument makes the resumable state.
# Raising from it ends the fit, which is how a caller cancels.
EpochCallback = Callable[[FitProgress, Callable[[], FitState]], None]


def best_device() -> torch.device:
    """CUDA where there is one, else the CPU."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def position_loss_m2(predicted_m: torch.Tensor, expected_m: torch.Tensor) -> torch.Tensor:
    """Equation (4): mean over rows of the squared position error in x plus that in y; m**2."""
    return (predicted_m - expected_m).square().sum(dim=1).mean()


def fit(
    residual: Residual,
    train: Rows,
    validation: Rows,
    config: FitConfig,
    *,
    on_epoch: EpochCallback | None = None,
    resume: FitState | None = None,
    device: torch.device | None = None,
) -> FitOutcome:
    """Fit the residual in place, keeping the averaged weights with the lowest validation loss.

    The same seed, rows, config and machine give the same weights, also when stopped after any epoch and
    resumed from its state. Raises TrainingError when a loss stops being finite.
    """
    started, device = time.monotonic(), device or best_device()
    train, validation = train.to(device), validation.thinned(config.validation_rows).to(device)
    if not residual.state_dict():  # nothing to fit: the zero residual
        loss = float(position_loss_m2(residual.to(device)(validation.inputs), validation.targets_m))
        return FitOutcome(0, 0, loss, False, time.monotonic() - started, str(device))
    fitting = _Fitting(residual, config, resume, device)
    first_epoch = fitting.epoch

    while fitting.epoch < config.epochs and fitting.epochs_without_gain < config.patience_epochs:
        train_loss = fitting.train_one_epoch(train)
        validation_loss = fitting.validate(validation)
        if not (math.isfinite(train_loss) and math.isfinite(validation_loss)):
            raise TrainingError(f"the loss is not finite after epoch {fitting.epoch}: lower learning_rate")
        if on_epoch:
            elapsed = time.monotonic() - started
            remaining = elapsed / (fitting.epoch - first_epoch) * (config.epochs - fitting.epoch)
            epochs = fitting.epoch, config.epochs
            losses = train_loss, validation_loss
            on_epoch(FitProgress(*epochs, *losses, fitting.best_epoch, elapsed, remaining), fitting.state)

    fitting.keep_best()
    stopped_early, elapsed = fitting.epoch < config.epochs, time.monotonic() - started
    return FitOutcome(fitting.epoch, fitting.best_epoch, fitting.best_loss_m2, stopped_early, elapsed, str(device))


class _Fitting:
    """The moving parts of one fit: weights, their average, optimiser, and the best epoch so far."""

    def __init__(self, residual: Residual, config: FitConfig, resume: FitState | None, device: torch.device) -> None:
        self.residual, self.config, self.device = residual, config, device
        if resume:
            residual.load_state_dict(resume.weights)
        residual.to(device).train()
        self.optimiser = torch.optim.Adam(residual.parameters(), lr=config.learning_rate)
        start = weights_of(residual)
        state = resume or FitState(0, 0, math.inf, start, start, start, {})
        if state.optimiser:
            load_optimiser(self.optimiser, state.optimiser)
        self.epoch, self.best_epoch, self.best_loss_m2 = state.epoch, state.best_epoch, state.best_loss_m2
        self.averages = {name: tensor.to(device, copy=True) for name, tensor in state.averages.items()}
        self.best = state.best

    @property
    def epochs_without_gain(self) -> int:
        return self.epoch - self.best_epoch

    def train_one_epoch(self, rows: Rows) -> float:
        """One pass over this epoch's draw of rows; returns the mean loss of its batches, m**2."""
        generator = torch.Generator().manual_seed(self.config.seed * 1_000_003 + self.epoch)
        order = torch.randperm(len(rows), generator=generator)[: self.config.rows_per_epoch].to(self.device)
        batches = torch.split(order, self.config.batch_rows)
        total = torch.zeros((), device=self.device)
        for number, batch in enumerate(batches):
            self._set_learning_rate(self.epoch + number / len(batches))
            loss = position_loss_m2(self.residual(rows.inputs[batch]), rows.targets_m[batch])
            self.optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            self.optimiser.step()
            self._update_averages(self.epoch * len(batches) + number)
            total += loss.detach() * len(batch)
        self.epoch += 1
        return float(total) / len(order)

    def validate(self, rows: Rows) -> float:
        """Loss of the averaged weights, m**2; remembers them when they are the best so far."""
        with torch.inference_mode():
            predicted = torch.func.functional_call(self.residual, self.averages, (rows.inputs,))
            loss = float(position_loss_m2(predicted, rows.targets_m))
        if loss < self.best_loss_m2:
            self.best, self.best_epoch, self.best_loss_m2 = self._averages_on_cpu(), self.epoch, loss
        return loss

    def keep_best(self) -> None:
        """Leave the best averaged weights in the residual, on the CPU."""
        self.residual.load_state_dict(self.best)
        self.residual.to("cpu").eval()

    def state(self) -> FitState:
        """The resumable state as of now."""
        numbers = self.epoch, self.best_epoch, self.best_loss_m2
        optimiser = optimiser_tensors(self.optimiser)
        return FitState(*numbers, weights_of(self.residual), self._averages_on_cpu(), self.best, optimiser)

    def _set_learning_rate(self, epoch: float) -> None:
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate_at(self.config, epoch)

    def _update_averages(self, step: int) -> None:
        # A short memory at first, or the average would remember the random start for hundreds of steps.
        decay = min(self.config.average_decay, (1 + step) / (10 + step))
        with torch.no_grad():
            for name, weight in self.residual.state_dict().items():
                self.averages[name].lerp_(weight, 1 - decay)

    def _averages_on_cpu(self) -> dict[str, torch.Tensor]:
        return {name: tensor.detach().to("cpu", copy=True) for name, tensor in self.averages.items()}
