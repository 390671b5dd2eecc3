"""What follows from a grid of times is kept for who asks for the same grid next: most do.

`sample_times` gives all of them the same array, which nobody can write to; hashing one takes as long as writing it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy.typing as npt

_Found = TypeVar("_Found")
_MOST, _MOST_TIMES = 8, 20_001  # no more of either: a grid and what follows from it are half a megabyte
_Array = npt.NDArray[Any]


class Kept(Generic[_Found]):
    """A function of an array, and of others that are hashed, which keeps what it found for the last few arrays that
    cannot change.
    """

    def __init__(self, find: Callable[..., _Found]) -> None:
        self._find, self._found, self._lock = find, dict[Hashable, tuple[_Array, _Found]](), Lock()

    def __call__(self, array: _Array, *others: Hashable) -> _Found:
        """As the function alone."""
        key = id(array), others
        known = self._found.get(key)
        if known is not None:  # and the array too, so that no other one has its place
            return known[1]
        found = self._find(array, *others)
        if array.size <= _MOST_TIMES and not array.flags.writeable and array.base is None:
            with self._lock:
                while len(self._found) >= _MOST:
                    del self._found[next(iter(self._found))]
                self._found[key] = array, found
        return found


def kept(find: Callable[..., _Found]) -> Kept[_Found]:
    """A decorator."""
    return Kept(find)
