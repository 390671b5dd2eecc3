"""Checkpoint <-> model for networks. `checkpoint` imports it when one comes by, and with it torch, which is large."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import safetensors.torch
import torch

from service.errors import CheckpointError
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import make_residual
from service.learning.trajectory_model import TrajectoryModel
from service.learning.weights import read_weights
from service.physics.prior import Prior


def describe_network(model: TrajectoryModel) -> tuple[dict[str, Any], Any]:
    """Architecture and inputs as JSON values. Raises TypeError for what is no network."""
    network = _network(model)
    architecture = {"name": network.residual.name, "arguments": network.residual.arguments}
    return architecture, network.signature.describe()


def network_bytes(model: TrajectoryModel) -> bytes:
    """The network's weights as a safetensors file. Raises TypeError for what is no network."""
    tensors = {name: tensor.contiguous() for name, tensor in _network(model).residual.state_dict().items()}
    return safetensors.torch.save(tensors)


def restore_network(description: Mapping[str, Any], prior: Prior, weights: bytes) -> PhysicsInformedModel:
    """The model of `checkpoint.restore_model`.

    Raises CheckpointError for weights that do not fit, and KeyError, TypeError or ValueError for a description that
    does not.
    """
    signature = InputSignature.restore(description["inputs"], prior.rover, prior.regolith)
    architecture = description["architecture"]
    residual = make_residual(architecture["name"], architecture["arguments"])
    tensors = read_weights(safetensors.torch.load, weights)
    _require_fitting(residual.state_dict(), tensors)
    residual.load_state_dict(tensors)
    return PhysicsInformedModel(prior, signature, residual)


def _network(model: TrajectoryModel) -> PhysicsInformedModel:
    if not isinstance(model, PhysicsInformedModel):
        raise TypeError(f"{type(model).__name__} has no form in a checkpoint")
    return model


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
