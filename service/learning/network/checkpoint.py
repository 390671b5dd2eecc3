"""Checkpoint <-> model for networks. Torch is not needed to read or write one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import safetensors.numpy

from service.learning.network.corrections import make_correction
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.trajectory_model import TrajectoryModel
from service.learning.weights import read_weights
from service.physics.prior import Prior


def describe_network(model: TrajectoryModel) -> tuple[dict[str, Any], Any]:
    """Architecture and inputs as JSON values. Raises TypeError for what is no network."""
    network = _network(model)
    architecture = {"name": network.correction.name, "arguments": network.correction.arguments}
    return architecture, network.signature.describe()


def network_bytes(model: TrajectoryModel) -> bytes:
    """The network's weights as a safetensors file. Raises TypeError for what is no network."""
    return safetensors.numpy.save(dict(_network(model).correction.tensors))


def restore_network(description: Mapping[str, Any], prior: Prior, weights: bytes) -> PhysicsInformedModel:
    """The model of `checkpoint.restore_model`.

    Raises CheckpointError for weights that do not fit, and KeyError, TypeError or ValueError for a description that
    does not.
    """
    signature = InputSignature.restore(description["inputs"], prior.rover, prior.regolith)
    architecture = description["architecture"]
    tensors = read_weights(safetensors.numpy.load, weights)
    return PhysicsInformedModel(
        prior, signature, make_correction(architecture["name"], architecture["arguments"], tensors)
    )


def _network(model: TrajectoryModel) -> PhysicsInformedModel:
    if not isinstance(model, PhysicsInformedModel):
        raise TypeError(f"{type(model).__name__} has no form in a checkpoint")
    return model
