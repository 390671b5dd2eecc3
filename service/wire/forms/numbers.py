"""Numbers as text: the shortest decimals that read back as the same float64. NaN and infinity never pass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np
import orjson

from service.physics.scenario import Array
from service.twin import NonFiniteError

_MOST_KEPT_TIMES = 20_001
_NO_NUMBERS = frozenset({str, int, bool, bytes, type(None), orjson.Fragment})


def dump(value: object) -> bytes:
    """Compact JSON; arrays become lists of numbers.

    Raises NonFiniteError instead of writing NaN or infinity, which orjson would turn into null without a word.
    """
    require_finite(value, "answer")
    return dump_finite(value)


def dump_finite(value: object) -> bytes:
    """`dump` of what is known to be finite."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)


def times_text(time_s: Array) -> orjson.Fragment:
    """Times as JSON, kept for who asks for the same ones next: most ask for the same grid. Raises NonFiniteError."""
    return orjson.Fragment(_kept_text(time_s.tobytes()) if len(time_s) <= _MOST_KEPT_TIMES else dump(time_s))


@lru_cache(maxsize=16)
def _kept_text(times: bytes) -> bytes:
    return dump(np.frombuffer(times))


def require_finite(value: object, where: str) -> None:
    """Raises NonFiniteError for NaN or infinity in arrays, numbers, and mappings, sequences and dataclasses of them."""
    place = _place_of_fault(value)
    if place is not None:
        raise NonFiniteError(f"{where}{place} is not finite: the answer was not sent")


def require_finite_columns(columns: Mapping[str, Array], where: str) -> None:
    """The same for columns of numbers, in less time."""
    for name, values in columns.items():
        if not np.isfinite(values).all():
            raise NonFiniteError(f"{where}.{name} is not finite: the answer was not sent")


def _place_of_fault(value: object) -> str | None:
    """Where inside the value something is not finite; empty if it is the value itself, None if nothing is."""
    kind = type(value)
    if kind in _NO_NUMBERS or isinstance(value, str):
        return None
    if isinstance(value, float):
        return None if math.isfinite(value) else ""
    if names := getattr(kind, "__dataclass_fields__", None):
        return _first_fault(((name, getattr(value, name)) for name in names), ".{}")
    if isinstance(value, np.ndarray):
        return None if np.isfinite(value).all() else ""
    if isinstance(value, Mapping):
        return _first_fault(value.items(), ".{}")
    if isinstance(value, list | tuple):
        return _first_fault(enumerate(value), "[{}]")
    return None


def _first_fault(members: Iterable[tuple[object, object]], step: str) -> str | None:
    for name, member in members:
        place = _place_of_fault(member)
        if place is not None:
            return step.format(name) + place
    return None
