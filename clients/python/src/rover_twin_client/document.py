"""Reads a parsed JSON document, member by member. An error names the path of the member that does not fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rover_twin_client.answers import Array, Flags, Words
from rover_twin_client.errors import UnexpectedAnswerError

Scalar = TypeVar("Scalar", bound=np.generic)
Value = TypeVar("Value")
LONGEST_WORD = 40  # in an array every word takes the memory of the longest one


@dataclass(frozen=True, slots=True)
class Node:
    """One value of a JSON document and its path. A method raises UnexpectedAnswerError when the value does not fit."""

    value: Any
    path: str = "answer"

    def __getitem__(self, key: str) -> Node:
        """The member `key` of an object, which must be there."""
        if key not in self._object():
            raise UnexpectedAnswerError(f"{self.path} has no member {key!r}: is this a rover-twin service?")
        return Node(self.value[key], f"{self.path}.{key}")

    def get(self, key: str) -> Node | None:
        """The member `key` of an object, or None when it is missing or null."""
        return None if self._object().get(key) is None else self[key]

    def optional(self, key: str, read: Callable[[Node], Value]) -> Value | None:
        """What `read` makes of the member `key`, or None when the member is missing or null."""
        member = self.get(key)
        return None if member is None else read(member)

    def members(self) -> Iterator[tuple[str, Node]]:
        """Each name and value of an object, in its own order."""
        return ((key, self[key]) for key in self._object())

    def items(self, length: int | None = None) -> Iterator[Node]:
        """Each item of a list, in its own order. With `length`, the list must have that many items."""
        if not isinstance(self.value, list):
            raise self._unfit("a list")
        if length is not None and len(self.value) != length:
            raise self._unfit(f"a list of length {length}, but it has {len(self.value)}")
        return (Node(item, f"{self.path}[{at}]") for at, item in enumerate(self.value))

    def text(self) -> str:
        """A string."""
        if not isinstance(self.value, str):
            raise self._unfit("a string")
        return self.value

    def flag(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            raise self._unfit("true or false")
        return self.value

    def whole(self) -> int:
        """An integer."""
        if not isinstance(self.value, int) or isinstance(self.value, bool):
            raise self._unfit("an integer")
        return self.value

    def number(self) -> float:
        """A finite number."""
        if not isinstance(self.value, int | float) or isinstance(self.value, bool):
            raise self._unfit("a number")
        try:
            number = float(self.value)
        except OverflowError as fault:  # an integer of more than 308 digits
            raise self._unfit("a finite number") from fault
        if not math.isfinite(number):
            raise self._unfit("a finite number")
        return number

    def moment(self) -> datetime:
        """A time with a time zone."""
        try:
            moment = datetime.fromisoformat(self.text())
        except ValueError as fault:
            raise self._unfit("a time") from fault
        if moment.tzinfo is None:
            raise self._unfit("a time with a time zone")
        return moment

    def array(self, length: int | None = None) -> Array:
        """A list of finite numbers as a read-only float64 array (N,). With `length`, N must be that."""
        try:
            numbers = np.asarray(self.value)
        except ValueError as ragged:
            raise self._unfit("a flat list of numbers") from ragged
        # NumPy would also convert strings of digits, booleans and nulls; only numbers may pass.
        if numbers.ndim != 1 or numbers.size == 0 or numbers.dtype.kind not in "fiu":
            raise self._unfit("a flat list of numbers, at least one")
        if not np.isfinite(numbers).all():
            raise self._unfit("a list of finite numbers")
        if length is not None and numbers.size != length:
            raise self._unfit(f"a list of length {length}, but it has {numbers.size}")
        return _read_only(numbers.astype(np.float64))

    def numbers(self, *shape: int, gaps: bool = False) -> Array:
        """Nested lists of finite numbers as a read-only float64 array of this shape; with `gaps`, null becomes NaN."""
        cells = self._cells(*shape)
        numbers = [math.nan if gaps and cell.value is None else cell.number() for cell in cells]
        return _read_only(np.array(numbers, dtype=np.float64).reshape(shape))

    def flags(self, *shape: int) -> Flags:
        """Nested lists of true and false as a read-only array of this shape."""
        return _read_only(np.array([cell.flag() for cell in self._cells(*shape)], dtype=np.bool_).reshape(shape))

    def words(self, *shape: int) -> Words:
        """Nested lists of short strings as a read-only array of this shape."""
        return _read_only(np.array([cell.word() for cell in self._cells(*shape)], dtype=np.str_).reshape(shape))

    def word(self) -> str:
        """A short string."""
        if len(self.text()) > LONGEST_WORD:
            raise self._unfit(f"at most {LONGEST_WORD} characters")
        return self.text()

    def _cells(self, *shape: int) -> Iterator[Node]:
        """The innermost items of nested lists of this shape; the last index varies fastest."""
        if not shape:
            yield self
            return
        for item in self.items(shape[0]):
            yield from item._cells(*shape[1:])

    def _object(self) -> dict[str, Any]:
        if not isinstance(self.value, dict):
            raise self._unfit("an object")
        return self.value

    def _unfit(self, wanted: str) -> UnexpectedAnswerError:
        return UnexpectedAnswerError(f"{self.path} is {_shortened(self.value)}, expected {wanted}")


def _read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.setflags(write=False)
    return array


def _shortened(value: object, longest: int = 60) -> str:
    shown = repr(value)
    return shown if len(shown) <= longest else f"{shown[:longest]}..."
