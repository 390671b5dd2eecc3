"""Bytes of a safetensors file -> tensors, of whichever library, with one kind of error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import safetensors

from service.errors import CheckpointError

T = TypeVar("T")


def read_weights(load: Callable[[bytes], T], weights: bytes) -> T:
    """What `load` (`safetensors.numpy.load` or its like) makes of the bytes. Raises CheckpointError."""
    try:
        return load(weights)
    except (safetensors.SafetensorError, ValueError, KeyError) as error:
        raise CheckpointError(f"the weights cannot be read as safetensors: {error}") from error
