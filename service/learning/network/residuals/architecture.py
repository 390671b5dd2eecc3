"""What a residual is: a torch module from scaled inputs to a correction in metres."""

from __future__ import annotations

from typing import Any, ClassVar

import torch


class Residual(torch.nn.Module):
    """Maps scaled inputs of shape (row, input) to corrections (dx, dy) in metres, shape (row, 2).

    The first input is the time. `arguments` are the constructor's, as JSON values.
    """

    name: ClassVar[str]
    arguments: dict[str, Any]
    input_count: int
