"""Who wants to see the calls to the place for bytes (traces do) gives a block to put around each of them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Observer = Callable[[str, str], AbstractContextManager[object]]
"""Called with what is done (`read`, `list`, ...) and the key; the call runs inside the block that it returns."""

_NOTHING: AbstractContextManager[None] = nullcontext()
_observer: Observer | None = None


def observe_calls(observer: Observer | None) -> None:
    """Put the observer's block around every call in this process from here on; None ends that."""
    global _observer
    _observer = observer


def observed(doing: str, key: str) -> AbstractContextManager[object]:
    """The block for one call."""
    return _NOTHING if _observer is None else _observer(doing, key)
