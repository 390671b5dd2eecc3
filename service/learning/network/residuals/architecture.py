"""What a residual is: a torch module from scaled inputs to a correction in metres."""

from __future__ import annotations

from typing import Any, ClassVar

import torch

from service.learning.network.corrections import Correction, make_correction


class Residual(torch.nn.Module):
    """Maps scaled inputs of shape (row, input) to corrections (dx, dy) in metres, shape (row, 2).

    The first input is the time. `arguments` are the constructor's, as JSON values.
    """

    name: ClassVar[str]
    arguments: dict[str, Any]
    input_count: int

    def correction(self) -> Correction:
        """What answers with the weights of now. Raises CheckpointError for weights that are not finite."""
        tensors = {name: tensor.detach().cpu().numpy().copy() for name, tensor in self.state_dict().items()}
        return make_correction(self.name, self.arguments, tensors)
