"""Reads a parsed JSON document member by member, naming the path of whatever does not fit. Knows no field of ours."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_twin_client.answers import Array
from rover_twin_client.errors import UnexpectedAnswerError


@dataclass(frozen=True, slots=True)
class Node:
    """One value of a JSON document and where it stands; every reader raises UnexpectedAnswerError."""

    value: Any
    path: str = "answer"

    def __getitem__(self, key: str) -> Node:
        """The member `key` of an object, which must be there."""
        if key not in self._object():
            raise UnexpectedAnswerError(f"{self.path} has no member {key!r}: is this a rover-twin service?")
        return Node(self.value[key], f"{self.path}.{key}")

    def get(self, key: str) -> Node | None:
        """The member `key` of an object, or None where it is missing or null."""
        return None if self._object().get(key) is None else self[key]

    def members(self) -> Iterator[tuple[str, Node]]:
        """Each name and value of an object, in the order sent."""
        return ((key, self[key]) for key in self._object())

    def items(self) -> Iterator[Node]:
        """Each item of a list, in the order sent."""
        if not isinstance(self.value, list):
            raise self._unfit("a list")
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

    def array(self, length: int | None = None) -> Array:
        """A list of finite numbers as a read-only float64 array (N,), N being `length` where it is given."""
        try:
            numbers = np.asarray(self.value)
        except ValueError as ragged:
            raise self._unfit("a flat list of numbers") from ragged
        # Strings of digits, booleans and nulls would all convert; only real numbers may pass.
        if numbers.ndim != 1 or numbers.size == 0 or numbers.dtype.kind not in "fiu":
            raise self._unfit("a flat list of numbers, at least one")
        if not np.isfinite(numbers).all():
            raise self._unfit("a list of finite numbers")
        if length is not None and numbers.size != length:
            raise self._unfit(f"as long as time_s ({length}), but has {numbers.size} numbers")
        numbers = numbers.astype(np.float64)
        numbers.setflags(write=False)
        return numbers

    def _object(self) -> dict[str, Any]:
        if not isinstance(self.value, dict):
            raise self._unfit("an object")
        return self.value

    def _unfit(self, wanted: str) -> UnexpectedAnswerError:
        return UnexpectedAnswerError(f"{self.path} is {_shortened(self.value)}, expected {wanted}")


def _shortened(value: object, longest: int = 60) -> str:
    shown = repr(value)
    return shown if len(shown) <= longest else f"{shown[:longest]}..."
