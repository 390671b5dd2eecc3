"""Runs as rows for the fit: scaled inputs and the displacement that the residual must explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from service.learning.network.inputs import InputSignature
from service.learning.observed import ObservedRun, require_constant
from service.physics.prior import Prior


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Scaled inputs (row, input) and target corrections in metres (row, 2), float32 tensors on one device."""

    inputs: torch.Tensor
    targets_m: torch.Tensor

    def __len__(self) -> int:
        return len(self.inputs)

    def to(self, device: torch.device) -> Rows:
        """The same rows on another device."""
        return Rows(self.inputs.to(device), self.targets_m.to(device))

    def thinned(self, most: int) -> Rows:
        """At most `most` of the rows, evenly spread."""
        step = -(-len(self) // most)
        return Rows(self.inputs[::step], self.targets_m[::step])


def rows_of(runs: Sequence[ObservedRun], prior: Prior, signature: InputSignature) -> Rows:
    """All samples of the runs, one row each, in order. Targets are run minus prior, metres.

    Raises ValueError without runs, TrainingError for runs whose slope, torque or brake change.
    """
    if not runs:
        raise ValueError("rows need at least one run")
    require_constant(runs)
    inputs, targets = [], []
    for run in runs:
        times = signature.time_column(run.time_s)[:, None]
        columns = np.broadcast_to(signature.scenario_columns(run.scenario), (len(times), len(signature.inputs) - 1))
        inputs.append(np.concatenate([times, columns], axis=1).astype(np.float32))
        expected = prior.positions(run.scenario, run.time_s)
        targets.append(np.stack([run.x_m - expected.x_m[0], run.y_m - expected.y_m[0]], axis=1))
    return Rows(
        torch.from_numpy(np.concatenate(inputs)),
        torch.from_numpy(np.concatenate(targets).astype(np.float32)),
    )
