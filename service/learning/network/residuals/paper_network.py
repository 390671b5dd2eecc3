"""The paper's network: five dense layers (30, 120, 500, 50, 2) with ReLU between them (IAC-23-A3.IP.204, section 3)."""

from __future__ import annotations

import math
from typing import ClassVar, Literal, cast

import torch

from service.learning.network.residuals.architecture import Residual

WIDTHS = (30, 120, 500, 50, 2)
_MAXIMUM_INPUTS = 16


class PaperNetwork(Residual):
    """The paper's dense network on scaled inputs.

    `output_scale_m` multiplies its two outputs, so that weights of ordinary size give corrections in metres.
    `x_form` says what the first output stands for: "position", the x correction itself (the paper), or
    "mean_speed", the correction divided by the elapsed time, which makes the correction exactly zero at t = 0.
    The elapsed time is (1 + u)/2 of the training horizon for a scaled time u in -1..1. Past the horizon
    (u > 1) the layers are shown the horizon itself, so that the correction stays ("position") or goes on
    at its last mean speed ("mean_speed"), where bare ReLU layers would grow with every second.
    """

    name: ClassVar[str] = "paper_network"
    output_scale_m: torch.Tensor

    def __init__(
        self,
        input_count: int,
        output_scale_m: tuple[float, float] = (1.0, 1.0),
        x_form: Literal["position", "mean_speed"] = "position",
    ) -> None:
        super().__init__()
        if not 1 <= input_count <= _MAXIMUM_INPUTS:
            raise ValueError(f"input_count is {input_count}, allowed is 1 to {_MAXIMUM_INPUTS}")
        if len(output_scale_m) != 2 or not all(math.isfinite(s) and s > 0 for s in output_scale_m):
            raise ValueError(f"output_scale_m is {output_scale_m}, allowed is two positive numbers")
        if x_form not in ("position", "mean_speed"):
            raise ValueError(f"x_form is {x_form!r}, allowed is position or mean_speed")
        self.input_count = input_count
        self.x_form = x_form
        self.arguments = {"input_count": input_count, "output_scale_m": list(output_scale_m), "x_form": x_form}
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
