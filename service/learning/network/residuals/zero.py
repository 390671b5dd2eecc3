"""The residual that corrects nothing: a twin made with it answers the prior."""

from __future__ import annotations

from typing import ClassVar

import torch

from service.learning.network.corrections import ZeroCorrection
from service.learning.network.residuals.architecture import Residual


class ZeroResidual(Residual):
    """Corrections of exactly zero, for any number of inputs."""

    name: ClassVar[str] = ZeroCorrection.name

    def __init__(self, input_count: int) -> None:
        super().__init__()
        self.input_count = input_count
        self.arguments = {"input_count": input_count}

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Zeros of shape (row, 2)."""
        return inputs.new_zeros((inputs.shape[0], 2))
