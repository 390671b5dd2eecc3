"""Lines of one shape, written by the compiled library (`native/`) at once: pieces that all have, and what is different
between them, which is text already or lists of numbers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.wire.digits import (
    INTEGER,
    POINTER,
    READ_BEHIND,
    WIDEST,
    Piece,
    Writer,
    address_of,
    contiguous,
    library,
    list_text,
)


class _Place(ctypes.Structure):
    """`digits_place`."""

    _fields_: ClassVar = [
        ("values", POINTER),
        ("counts", POINTER),
        ("text", POINTER),
        ("ends", POINTER),
        ("width", INTEGER),
        ("decimals", INTEGER),
    ]


class Cells:
    """What is different in each line and text already: `text` has a comma behind each cell, where `ends` (row,) are."""

    __slots__ = ("ends", "text")

    def __init__(self, text: bytes, ends: npt.NDArray[np.int64]) -> None:
        self.text, self.ends = text + READ_BEHIND, ends

    @classmethod
    def of(cls, cells: Sequence[bytes]) -> Cells:
        """Any texts."""
        ends = np.cumsum(np.fromiter(map(len, cells), dtype=np.int64, count=len(cells)) + 1) - 1
        return cls(b",".join(cells) + b",", ends)

    @classmethod
    def listed(cls, text: bytes) -> Cells:
        """The members of a JSON list, which have no commas of their own."""
        text = text[1:-1] + b"," * (len(text) > 2)
        return cls(text, np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord(",")))

    def in_row(self, row: int) -> bytes:
        """That of one row."""
        return self.text[int(self.ends[row - 1]) + 1 if row else 0 : int(self.ends[row])]

    def within(self, rows: slice) -> int:
        """How many bytes those of some rows have, with their commas."""
        return int(self.ends[rows.stop - 1]) + 1 - (int(self.ends[rows.start - 1]) + 1 if rows.start else 0)


class Lists:
    """A list of numbers in each line: of `values` (row, n) the first `counts[row]`, with so many decimals at most."""

    __slots__ = ("counts", "decimals", "values")

    def __init__(self, values: Array, counts: npt.NDArray[np.intp], decimals: int) -> None:
        self.values, self.decimals = contiguous(values), decimals
        self.counts = np.ascontiguousarray(counts, dtype=np.int64)

    def within(self, rows: slice) -> int:
        """At most so many bytes have those of some rows."""
        count: int = rows.stop - rows.start
        return count * (int(self.values.shape[1]) * WIDEST + 2)

    def in_row(self, row: int) -> bytes:
        """That of one row. Raises NonFiniteError."""
        return list_text(self.values[row, : self.counts[row]], self.decimals)


class Lines:
    """Lines that have the same pieces, with what is different between them: `places`, and one piece more."""

    def __init__(self, places: Sequence[Lists | Cells], pieces: Sequence[bytes]) -> None:
        self._places, self._size = list(places), sum(map(len, pieces))
        self._told = (_Place * len(places))(*map(_told, self._places))
        self._kept = [piece + READ_BEHIND for piece in pieces]
        self._pieces = (Piece * len(pieces))(*map(Piece, self._kept, map(len, pieces)))

    def text(self, rows: slice) -> bytes:
        """The lines of some rows, which has a start and a stop. Raises NonFiniteError."""
        count, writer = rows.stop - rows.start, Writer()
        at = writer.room_for(count * self._size + sum(each.within(rows) for each in self._places))
        told, pieces = ctypes.addressof(self._told), ctypes.addressof(self._pieces)
        size = library().digits_lines(told, pieces, len(self._places), rows.start, count, at)
        writer.wrote(max(size, 0))
        text = writer.done()
        return b"".join(map(self._line, range(rows.start, rows.stop))) if size < 0 else text

    def _line(self, row: int) -> bytes:
        """One of them, whose numbers may be too large for their decimals. Raises NonFiniteError."""
        first, *more = (piece[: -len(READ_BEHIND)] for piece in self._kept)
        return first + b"".join(place.in_row(row) + piece for place, piece in zip(self._places, more, strict=True))


def _told(place: Lists | Cells) -> _Place:
    """What the library reads, while the place is there."""
    if isinstance(place, Cells):
        text = ctypes.cast(ctypes.c_char_p(place.text), POINTER)
        return _Place(text=text, ends=address_of(place.ends))
    width, counts = place.values.shape[1], address_of(place.counts)
    return _Place(values=address_of(place.values), counts=counts, width=width, decimals=place.decimals)
