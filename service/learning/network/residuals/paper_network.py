"""The paper's network: five dense layers (30, 120, 500, 50, 2) with ReLU between them (IAC-23-A3.IP.204, section 3)."""

from __future__ import annotations

from typing import ClassVar, Literal, cast

import torch

from service.learning.network.corrections import WIDTHS, PaperArguments, PaperCorrection
from service.learning.network.residuals.architecture import Residual


class PaperNetwork(Residual):
    """The paper's dense network on scaled inputs; `PaperArguments` says what it is made with."""

    name: ClassVar[str] = PaperCorrection.name
    output_scale_m: torch.Tensor

    def __init__(
        self,
        input_count: int,
        output_scale_m: tuple[float, float] = (1.0, 1.0),
        x_form: Literal["position", "mean_speed"] = "position",
    ) -> None:
        super().__init__()
        self.arguments = PaperArguments(input_count, output_scale_m, x_form).describe()
        self.input_count = input_count
        self.x_form = x_form
        layers: list[torch.nn.Module] = []
        for fan_in, fan_out in zip((input_count, *WIDTHS[:-1]), WIDTHS, strict=True):
            layers += [torch.nn.Linear(fan_in, fan_out), torch.nn.ReLU()]
        self.layers = torch.nn.Sequential(*layers[:-1])
        self.register_buffer("output_scale_m", torch.tensor(output_scale_m), persistent=False)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Corrections (dx, dy) in metres, shape (row, 2)."""
        seen = torch.cat([inputs[:, :1].clamp(max=1.0), inputs[:, 1:]], dim=1)
        corrections = cast("torch.Tensor", self.layers(seen)) * self.output_scale_m
        if self.x_form == "position":
            return corrections
        elapsed = (1.0 + inputs[:, :1]) / 2.0
        return torch.cat([corrections[:, :1] * elapsed, corrections[:, 1:]], dim=1)
