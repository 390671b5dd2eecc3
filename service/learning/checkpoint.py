"""Checkpoint <-> model: a JSON description plus safetensors weights. The architecture comes from a closed table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np
import safetensors.numpy
import safetensors.torch
import torch

from service.errors import CheckpointError
from service.learning.inputs import InputSignature
from service.learning.model import PhysicsInformedModel, TrajectoryModel
from service.learning.residuals import make_residual
from service.learning.resistance.model import ResistanceProcess
from service.physics.prior import Prior
from service.physics.priors import describe_prior, restore_prior

WEIGHTS_FILE = "weights.safetensors"
RESISTANCE_PROCESS = "resistance_process"
T = TypeVar("T")
_RESISTANCE_INPUTS = [
    {"name": "slope_deg", "unit": "deg"},
    {"name": "mass_kg", "unit": "kg"},
    {"name": "torque_ratio", "unit": "1"},
]
_OUTPUTS = [{"name": "x_correction_m", "unit": "m"}, {"name": "y_correction_m", "unit": "m"}]


def describe_model(model: TrajectoryModel) -> dict[str, Any]:
    """Everything about the model but its weights, as JSON values: what `restore_model` needs."""
    if isinstance(model, ResistanceProcess):
        architecture, inputs = {"name": RESISTANCE_PROCESS, "arguments": model.describe()}, _RESISTANCE_INPUTS
    elif isinstance(model, PhysicsInformedModel):
        architecture = {"name": model.residual.name, "arguments": model.residual.arguments}
        inputs = model.signature.describe()
    else:
        raise TypeError(f"{type(model).__name__} has no form in a checkpoint")
    return {
        "architecture": architecture,
        "inputs": inputs,
        "outputs": _OUTPUTS,
        "prior": describe_prior(model.prior),
    }


def weights_bytes(model: TrajectoryModel) -> bytes:
    """The model's learned numbers as a safetensors file, little-endian."""
    if isinstance(model, ResistanceProcess):
        return safetensors.numpy.save({name: np.ascontiguousarray(array) for name, array in model.tensors().items()})
    if isinstance(model, PhysicsInformedModel):
        tensors = {name: tensor.contiguous() for name, tensor in model.residual.state_dict().items()}
        return safetensors.torch.save(tensors)
    raise TypeError(f"{type(model).__name__} has no form in a checkpoint")


def restore_model(description: Mapping[str, Any], weights: bytes) -> TrajectoryModel:
    """Inverse of `describe_model` and `weights_bytes`.

    Raises CheckpointError when the description names something unknown, or when the weights are truncated, do not
    fit the architecture or hold NaN or infinity (safetensors checks none of the latter).
    """
    try:
        if description["outputs"] != _OUTPUTS:
            raise ValueError(f"outputs are {description['outputs']!r}, allowed is {_OUTPUTS!r}")  # noqa: TRY301
        prior = restore_prior(description["prior"])
        if description["architecture"]["name"] == RESISTANCE_PROCESS:
            arrays = _read(safetensors.numpy.load, weights)
            return ResistanceProcess.restore(description["architecture"]["arguments"], arrays, prior)
        return _restore_network(description, prior, weights)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"the checkpoint's description does not fit: {_reason(error)}") from error


def _restore_network(description: Mapping[str, Any], prior: Prior, weights: bytes) -> PhysicsInformedModel:
    signature = InputSignature.restore(description["inputs"], prior.rover, prior.regolith)
    architecture = description["architecture"]
    residual = make_residual(architecture["name"], architecture["arguments"])
    tensors = _read(safetensors.torch.load, weights)
    _require_fitting(residual.state_dict(), tensors)
    residual.load_state_dict(tensors)
    return PhysicsInformedModel(prior, signature, residual)


def _read(load: Callable[[bytes], T], weights: bytes) -> T:
    try:
        return load(weights)
    except (safetensors.SafetensorError, ValueError, KeyError) as error:
        raise CheckpointError(f"the weights cannot be read as safetensors: {error}") from error


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
