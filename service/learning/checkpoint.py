"""Checkpoint <-> model: a JSON description plus safetensors weights. The architecture comes from a closed table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import safetensors.torch
import torch

from service.errors import CheckpointError
from service.learning.inputs import InputSignature
from service.learning.model import PhysicsInformedModel
from service.learning.residuals import make_residual
from service.physics.priors import describe_prior, restore_prior

WEIGHTS_FILE = "weights.safetensors"
_OUTPUTS = [{"name": "x_correction_m", "unit": "m"}, {"name": "y_correction_m", "unit": "m"}]


def describe_model(model: PhysicsInformedModel) -> dict[str, Any]:
    """Everything about the model but its weights, as JSON values: what `restore_model` needs."""
    return {
        "architecture": {"name": model.residual.name, "arguments": model.residual.arguments},
        "inputs": model.signature.describe(),
        "outputs": _OUTPUTS,
        "prior": describe_prior(model.prior),
    }


def weights_bytes(model: PhysicsInformedModel) -> bytes:
    """The residual's weights as a safetensors file, little-endian float32."""
    return safetensors.torch.save({name: tensor.contiguous() for name, tensor in model.residual.state_dict().items()})


def restore_model(description: Mapping[str, Any], weights: bytes) -> PhysicsInformedModel:
    """Inverse of `describe_model` and `weights_bytes`.

    Raises CheckpointError when the description names something unknown, or when the weights are truncated, do not
    fit the architecture or hold NaN or infinity (safetensors checks none of the latter).
    """
    try:
        prior = restore_prior(description["prior"])
        signature = InputSignature.restore(description["inputs"], prior.rover, prior.regolith)
        architecture = description["architecture"]
        residual = make_residual(architecture["name"], architecture["arguments"])
        if description["outputs"] != _OUTPUTS:
            raise ValueError(f"outputs are {description['outputs']!r}, allowed is {_OUTPUTS!r}")  # noqa: TRY301
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"the checkpoint's description does not fit: {_reason(error)}") from error
    try:
        tensors = safetensors.torch.load(weights)
    except (safetensors.SafetensorError, ValueError, KeyError) as error:
        raise CheckpointError(f"the weights cannot be read as safetensors: {error}") from error
    _require_fitting(residual.state_dict(), tensors)
    residual.load_state_dict(tensors)
    try:
        return PhysicsInformedModel(prior, signature, residual)
    except ValueError as error:
        raise CheckpointError(f"the checkpoint's description does not fit: {error}") from error


def _require_fitting(expected: Mapping[str, torch.Tensor], found: Mapping[str, torch.Tensor]) -> None:
    if expected.keys() != found.keys():
        raise CheckpointError(f"the weights name {sorted(found)}, the architecture needs {sorted(expected)}")
    for name, tensor in found.items():
        if tensor.shape != expected[name].shape or tensor.dtype != expected[name].dtype:
            raise CheckpointError(
                f"weight {name} is {tensor.dtype} {tuple(tensor.shape)}, the architecture needs "
                f"{expected[name].dtype} {tuple(expected[name].shape)}"
            )
        if not bool(torch.isfinite(tensor).all()):
            raise CheckpointError(f"weight {name} holds values that are not finite")


def _reason(error: Exception) -> str:
    return f"{error.args[0]!r} is missing" if isinstance(error, KeyError) and error.args else str(error)
