"""Checkpoint <-> model: a JSON description plus safetensors weights. The architecture comes from a closed table.

`network.checkpoint` is imported when the first network comes by. Torch, which trains them, is not needed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import safetensors.numpy

from service.errors import CheckpointError
from service.learning.drive.model import DriveModel
from service.learning.trajectory_model import TrajectoryModel
from service.learning.weights import read_weights
from service.physics.priors import describe_prior, restore_prior

DRIVE_MODEL = "drive_model"
_DRIVE_INPUTS = [
    {"name": "slope_deg", "unit": "deg"},
    {"name": "mass_kg", "unit": "kg"},
    {"name": "torque_ratio", "unit": "1"},
]
# Architectures of earlier versions of this program, and what to do about them.
_FORMER = {
    "resistance_process": "a resistance process, which the drive model has replaced: train anew on its datasets with "
    "`rover-twin train ... --architecture drive_model`, or serve it with the release that trained it (code_version in "
    "its manifest)"
}
_OUTPUTS = [{"name": "x_correction_m", "unit": "m"}, {"name": "y_correction_m", "unit": "m"}]


def describe_model(model: TrajectoryModel) -> dict[str, Any]:
    """Everything about the model but its weights, as JSON values: what `restore_model` needs.

    Raises TypeError for a model that has no form in a checkpoint.
    """
    if isinstance(model, DriveModel):
        architecture, inputs = {"name": DRIVE_MODEL, "arguments": model.describe()}, _DRIVE_INPUTS
    else:
        from service.learning.network.checkpoint import describe_network  # noqa: PLC0415 - when one comes by

        architecture, inputs = describe_network(model)
    return {
        "architecture": architecture,
        "inputs": inputs,
        "outputs": _OUTPUTS,
        "prior": describe_prior(model.prior),
    }


def weights_bytes(model: TrajectoryModel) -> bytes:
    """The model's learned numbers as a safetensors file, little-endian. Raises TypeError as `describe_model` does."""
    if isinstance(model, DriveModel):
        return safetensors.numpy.save({name: np.ascontiguousarray(array) for name, array in model.tensors().items()})
    from service.learning.network.checkpoint import network_bytes  # noqa: PLC0415 - when one comes by

    return network_bytes(model)


def restore_model(description: Mapping[str, Any], weights: bytes) -> TrajectoryModel:
    """Inverse of `describe_model` and `weights_bytes`.

    Raises CheckpointError when the description names something unknown or an architecture of the past, or when the
    weights are truncated, do not fit the architecture or hold NaN or infinity (safetensors checks none of the latter).
    """
    try:
        if description["outputs"] != _OUTPUTS:
            raise ValueError(f"outputs are {description['outputs']!r}, allowed is {_OUTPUTS!r}")  # noqa: TRY301
        if former := _FORMER.get(str(description["architecture"]["name"])):
            raise CheckpointError(f"this version is {former}")
        prior = restore_prior(description["prior"])
        if description["architecture"]["name"] == DRIVE_MODEL:
            arrays = read_weights(safetensors.numpy.load, weights)
            return DriveModel.restore(description["architecture"]["arguments"], arrays, prior)
        from service.learning.network.checkpoint import restore_network  # noqa: PLC0415 - when one comes by

        return restore_network(description, prior, weights)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f"the checkpoint's description does not fit: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    return f"{error.args[0]!r} is missing" if isinstance(error, KeyError) and error.args else str(error)
