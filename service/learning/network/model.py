"""Prior plus residual: the formula of the paper's equation (3), for many scenarios and times at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from service.learning.network.inputs import InputSignature
from service.learning.network.residuals import Residual
from service.learning.trajectory_model import motion_by_difference
from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios

# Rows that go through the network together, so that the activations of its widest layer stay in cache.
_ROWS_AT_ONCE = 1024


@dataclass(frozen=True, slots=True)
class PhysicsInformedModel:
    """x_corr = x_phys + dx, y_corr = y_phys + dy (IAC-23-A3.IP.204, eq. 3). Immutable and safe to share by threads.

    The prior is evaluated in float64, the residual in float32, the sum in float64.
    """

    prior: Prior
    signature: InputSignature
    residual: Residual

    quick: ClassVar[bool] = False
    knows_wheel_speeds: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.residual.input_count != len(self.signature.inputs):
            raise ValueError(
                f"the residual takes {self.residual.input_count} inputs, the signature names "
                f"{len(self.signature.inputs)}"
            )
        self.residual.eval()

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Corrected positions (m), shape (scenario, time), at `time_s` of shape (time,) or (scenario, time)."""
        prior = self.prior.positions(scenarios, time_s)
        correction = self.corrections(scenarios, time_s)
        return Positions(prior.x_m + correction.x_m, prior.y_m + correction.y_m)

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        """The same positions with their speeds; the wheels' are not known."""
        return motion_by_difference(self.positions, scenarios, time_s)

    def corrections(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """What the residual adds (m), shape (scenario, time)."""
        columns = torch.from_numpy(self.signature.scenario_columns(scenarios))
        times = torch.from_numpy(self.signature.time_column(time_s))
        count = times.shape[-1]
        answer = np.empty((len(scenarios) * count, 2))
        with torch.inference_mode():
            for first in range(0, len(answer), _ROWS_AT_ONCE):
                at = torch.arange(first, min(first + _ROWS_AT_ONCE, len(answer)))
                scenario = at // count
                time = times[at % count] if times.ndim == 1 else times[scenario, at % count]
                answer[at.numpy()] = self.residual(torch.cat([time[:, None], columns[scenario]], dim=1)).numpy()
        corrections = answer.reshape(len(scenarios), count, 2)
        return Positions(corrections[..., 0], corrections[..., 1])
