"""Everything a fit needs to go on where it stopped, as safetensors bytes (never a pickle)."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Self

import safetensors.torch
import torch

from service.errors import TrainingError
from service.learning.network.residuals import Residual

Weights = dict[str, torch.Tensor]


def weights_of(residual: Residual) -> Weights:
    """A copy of the residual's weights on the CPU."""
    return {name: tensor.detach().to("cpu", copy=True) for name, tensor in residual.state_dict().items()}


@dataclass(frozen=True, slots=True)
class FitState:
    """State after `epoch` finished epochs. Each epoch's random numbers are seeded by its number: they need no state.

    `best_*` belong to the epoch with the lowest validation loss so far, `averages` to the exponential moving
    average of the weights that is what the fit evaluates and returns.
    """

    epoch: int
    best_epoch: int
    best_loss_m2: float
    weights: Weights
    averages: Weights
    best: Weights
    optimiser: Weights

    def to_bytes(self) -> bytes:
        """The state as one safetensors file."""
        tensors = {
            f"{part}.{name}": tensor.contiguous()
            for part in ("weights", "averages", "best", "optimiser")
            for name, tensor in getattr(self, part).items()
        }
        best_loss = self.best_loss_m2 if math.isfinite(self.best_loss_m2) else None
        numbers = {"epoch": self.epoch, "best_epoch": self.best_epoch, "best_loss_m2": best_loss}
        return safetensors.torch.save(tensors, metadata={"fit_state": json.dumps(numbers)})

    @classmethod
    def from_bytes(cls, data: bytes) -> Self:
        """Inverse of `to_bytes`. Raises TrainingError for bytes that are no fit state."""
        try:
            header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
            numbers = json.loads(header["__metadata__"]["fit_state"])
            tensors = safetensors.torch.load(data)
        except (KeyError, ValueError, safetensors.SafetensorError) as error:
            raise TrainingError(f"the saved state of the fit cannot be read: {error}") from error
        parts: dict[str, Weights] = {"weights": {}, "averages": {}, "best": {}, "optimiser": {}}
        for name, tensor in tensors.items():
            part, _, rest = name.partition(".")
            parts[part][rest] = tensor
        best_loss = math.inf if numbers["best_loss_m2"] is None else float(numbers["best_loss_m2"])
        return cls(int(numbers["epoch"]), int(numbers["best_epoch"]), best_loss, **parts)


def optimiser_tensors(optimiser: torch.optim.Optimizer) -> Weights:
    """Adam's moments and step counts as a flat table of CPU tensors."""
    state = optimiser.state_dict()["state"]
    return {
        f"{index}.{name}": torch.as_tensor(value).detach().to("cpu", copy=True)
        for index, values in state.items()
        for name, value in values.items()
    }


def load_optimiser(optimiser: torch.optim.Optimizer, tensors: Weights) -> None:
    """Inverse of `optimiser_tensors`, for an optimiser over the same parameters."""
    state: dict[int, dict[str, torch.Tensor]] = {}
    for key, tensor in tensors.items():
        index, _, name = key.partition(".")
        state.setdefault(int(index), {})[name] = tensor.clone()
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
