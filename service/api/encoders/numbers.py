"""Numbers as text: the shortest decimals that read back as the same float64. NaN and infinity never pass."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import orjson

from service.twin import NonFiniteError


def dump(value: object) -> bytes:
    """Compact JSON; arrays become lists of numbers.

    Raises NonFiniteError instead of writing NaN or infinity, which orjson would turn into null without a word.
    """
    require_finite(value, "answer")
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def require_finite(value: object, where: str) -> None:
    """Raises NonFiniteError for NaN or infinity in arrays, numbers, and mappings and lists of them."""
    if isinstance(value, np.ndarray):
        finite = bool(np.isfinite(value).all())
    elif isinstance(value, float):
        finite = math.isfinite(value)
    elif isinstance(value, Mapping):
        for name, member in value.items():
            require_finite(member, f"{where}.{name}")
        return
    elif isinstance(value, list):
        for at, member in enumerate(value):
            require_finite(member, f"{where}[{at}]")
        return
    else:
        return
    if not finite:
        raise NonFiniteError(f"{where} is not finite: the answer was not sent")
