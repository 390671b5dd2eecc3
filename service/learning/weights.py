"""Bytes of a safetensors file -> tensors, of whichever library, with one kind of error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import safetensors

from service.errors import CheckpointError

T = TypeVar("T")


def read_weights(load: Callable[[bytes], T], content: bytes, what: str = "weights") -> T:
    """What `load` (`safetensors.numpy.load` or its like) makes of the bytes. Raises CheckpointError."""
    try:
        return load(content)
    except (safetensors.SafetensorError, ValueError, KeyError) as error:
        raise CheckpointError(f"the {what} cannot be read as safetensors: {error}") from error
