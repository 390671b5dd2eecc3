"""Reading stored tensors with suspicion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from service.physics.scenario import Array

_MOST_ROWS = 100_000


class TensorReader:
    """Hands out each tensor once, checked. Every method raises ValueError for what does not fit."""

    def __init__(self, tensors: Mapping[str, Array]) -> None:
        self._left = dict(tensors)

    def length(self, name: str) -> int:
        """Number of rows of a tensor that is still there; 1 at least."""
        tensor = self._left.get(name)
        if tensor is None or np.ndim(tensor) < 1 or not 1 <= len(tensor) <= _MOST_ROWS:
            raise ValueError(f"tensor {name} is missing or has no rows, or more than {_MOST_ROWS}")
        return len(tensor)

    def take(self, name: str, shape: tuple[int, ...]) -> Array:
        """The tensor, which must be float64, finite and of that shape."""
        tensor = self._left.pop(name, None)
        if tensor is None:
            raise ValueError(f"tensor {name} is missing")
        array = np.asarray(tensor)
        if array.dtype != np.float64 or array.shape != shape:
            raise ValueError(f"tensor {name} is {array.dtype} of shape {array.shape}, allowed is float64 of {shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"tensor {name} holds NaN or infinity")
        return np.ascontiguousarray(array)

    def require_nothing_left(self) -> None:
        """No tensor may be there that nobody asked for."""
        if self._left:
            raise ValueError(f"tensors {', '.join(sorted(self._left))} are not part of this model")
