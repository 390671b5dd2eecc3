"""Fitting a residual: epochs are a generator, and its consumer decides when to stop. Knows no files, queues or HTTP."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
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


def best_device() -> torch.device:
    """CUDA where there is one, else the CPU."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def position_loss_m2(predicted_m: torch.Tensor, expected_m: torch.Tensor) -> torch.Tensor:
    """Equation (4): mean over rows of the squared position error in x plus that in y; m**2."""
    return (predicted_m - expected_m).square().sum(dim=1).mean()


class NetworkFit:
    """One fit of a residual, in place: epoch after epoch, then the averaged weights of the best one.

    The same seed, rows, config and machine give the same weights, also when `resume` is the state that another
    fit had after any epoch. `epoch` counts those that are finished, before `resume` as well.
    """

    def __init__(
        self,
        residual: Residual,
        train: Rows,
        validation: Rows,
        config: FitConfig,
        *,
        resume: FitState | None = None,
        device: torch.device | None = None,
    ) -> None:
        self._started = time.monotonic()
        self._residual, self._config, self._device = residual, config, device or best_device()
        self._train = train.to(self._device)
        self._validation = validation.thinned(config.validation_rows).to(self._device)
        if resume:
            residual.load_state_dict(resume.weights)
        residual.to(self._device).train()
        # As a group, because Adam refuses a bare list without parameters, which is what the zero residual has.
        self._optimiser = torch.optim.Adam([{"params": list(residual.parameters())}], lr=config.learning_rate)
        start = weights_of(residual)
        state = resume or FitState(0, 0, math.inf, start, start, start, {})
        if state.optimiser:
            load_optimiser(self._optimiser, state.optimiser)
        self.epoch, self._best_epoch, self._best_loss_m2 = state.epoch, state.best_epoch, state.best_loss_m2
        self._averages = {name: tensor.to(self._device, copy=True) for name, tensor in state.averages.items()}
        self._best = state.best

    @property
    def finished(self) -> bool:
        """Whether no epoch is left: all are done, or none was better for too long, or there are no weights to fit."""
        without_gain = self.epoch - self._best_epoch
        return not self._averages or self.epoch >= self._config.epochs or without_gain >= self._config.patience_epochs

    def epochs(self) -> Iterator[FitProgress]:
        """Fit the epochs that are left, telling after each where the fit stands.

        A consumer may leave after any of them, and then take the state, finish, or go on with the rest. Raises
        TrainingError when a loss stops being finite.
        """
        started, first_epoch, epochs = time.monotonic(), self.epoch, self._config.epochs
        while not self.finished:
            train_loss = self._train_one_epoch()
            validation_loss = self._validate()
            if not (math.isfinite(train_loss) and math.isfinite(validation_loss)):
                raise TrainingError(f"the loss is not finite after epoch {self.epoch}: lower learning_rate")
            elapsed = time.monotonic() - started
            remaining = elapsed / (self.epoch - first_epoch) * (epochs - self.epoch)
            losses = train_loss, validation_loss
            yield FitProgress(self.epoch, epochs, *losses, self._best_epoch, elapsed, remaining)

    def state(self) -> FitState:
        """The resumable state as of now."""
        numbers = self.epoch, self._best_epoch, self._best_loss_m2
        optimiser = optimiser_tensors(self._optimiser)
        return FitState(*numbers, weights_of(self._residual), self._averages_on_cpu(), self._best, optimiser)

    def finish(self) -> FitOutcome:
        """Leave the averaged weights of the best epoch so far in the residual, on the CPU; no epoch may follow."""
        if not self.epoch:
            self._validate()
        self._residual.load_state_dict(self._best)
        self._residual.to("cpu").eval()
        stopped_early, elapsed = 0 < self.epoch < self._config.epochs, time.monotonic() - self._started
        best = self._best_epoch, self._best_loss_m2
        return FitOutcome(self.epoch, *best, stopped_early, elapsed, str(self._device))

    def _train_one_epoch(self) -> float:
        """One pass over this epoch's draw of rows; returns the mean loss of its batches, m**2."""
        rows, config = self._train, self._config
        generator = torch.Generator().manual_seed(config.seed * 1_000_003 + self.epoch)
        order = torch.randperm(len(rows), generator=generator)[: config.rows_per_epoch].to(self._device)
        batches = torch.split(order, config.batch_rows)
        total = torch.zeros((), device=self._device)
        for number, batch in enumerate(batches):
            self._set_learning_rate(self.epoch + number / len(batches))
            loss = position_loss_m2(self._residual(rows.inputs[batch]), rows.targets_m[batch])
            self._optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            self._optimiser.step()
            self._update_averages(self.epoch * len(batches) + number)
            total += loss.detach() * len(batch)
        self.epoch += 1
        return float(total) / len(order)

    def _validate(self) -> float:
        """Loss of the averaged weights, m**2; remembers them when they are the best so far."""
        rows = self._validation
        with torch.inference_mode():
            predicted = torch.func.functional_call(self._residual, self._averages, (rows.inputs,))
            loss = float(position_loss_m2(predicted, rows.targets_m))
        if loss < self._best_loss_m2:
            self._best, self._best_epoch, self._best_loss_m2 = self._averages_on_cpu(), self.epoch, loss
        return loss

    def _set_learning_rate(self, epoch: float) -> None:
        for group in self._optimiser.param_groups:
            group["lr"] = learning_rate_at(self._config, epoch)

    def _update_averages(self, step: int) -> None:
        # A short memory at first, or the average would remember the random start for hundreds of steps.
        decay = min(self._config.average_decay, (1 + step) / (10 + step))
        with torch.no_grad():
            for name, weight in self._residual.state_dict().items():
                self._averages[name].lerp_(weight, 1 - decay)

    def _averages_on_cpu(self) -> dict[str, torch.Tensor]:
        return {name: tensor.detach().to("cpu", copy=True) for name, tensor in self._averages.items()}
