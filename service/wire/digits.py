"""Numbers as text by the compiled library (`native/`): many of them, rounded to a number of decimals.

NaN and infinity raise NonFiniteError. A column with a number too large for that many decimals (2e8 m at 1e-7 m) is
written with all its digits, as orjson has them.
"""

from __future__ import annotations

import ctypes
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import orjson

from service.physics.scenario import Array
from service.twin import NonFiniteError

PATH = Path(__file__).with_name("native") / "libdigits.so"
INTERFACE = 3  # DIGITS_INTERFACE of native/digits.h
MOST_COLUMNS = 32  # DIGITS_MOST_COLUMNS
MOST_DECIMALS = 15  # DIGITS_MOST_DECIMALS
WIDEST, _SLACK = 20, 64  # DIGITS_WIDEST, DIGITS_SLACK
READ_BEHIND = bytes(16)  # what may be read behind a text
_KEPT_ROOMS, _FIRST_BYTES, _KEPT_BYTES = (
    4,
    1 << 16,
    4 << 20,
)  # memory that is kept for the next text: asking for it takes as long as writing
_LONG_BYTES = 4096  # zlib has done fewer before ours is called
_REMEDY = "run `pip install .` (or `pip install --editable .`, or `make run`) again in the checkout: that compiles it"

INTEGER, POINTER = ctypes.c_int64, ctypes.c_void_p


class _Column(ctypes.Structure):
    """`digits_column`."""

    _fields_: ClassVar = [("values", POINTER), ("text", POINTER), ("decimals", INTEGER), ("point", INTEGER)]


class Piece(ctypes.Structure):
    """`digits_piece`."""

    _fields_: ClassVar = [("text", ctypes.c_char_p), ("size", INTEGER)]


_ARGUMENTS: dict[str, list[type]] = {
    "digits_checksum": [POINTER, INTEGER, INTEGER],
    "digits_interface": [],
    "digits_lines": [POINTER, POINTER, INTEGER, INTEGER, INTEGER, POINTER],
    "digits_list": [POINTER, INTEGER, INTEGER, POINTER],
    "digits_lists": [POINTER, INTEGER, INTEGER, POINTER, INTEGER, POINTER],
    "digits_table": [POINTER, POINTER, INTEGER, INTEGER, POINTER],
}


@cache
def library() -> ctypes.CDLL:
    """The library at PATH, loaded once. Raises ImportError, with the remedy, for one that is missing or another."""
    try:
        loaded = ctypes.CDLL(str(PATH))
        for name, arguments in _ARGUMENTS.items():
            function = getattr(loaded, name)
            function.argtypes, function.restype = arguments, INTEGER
    except (OSError, AttributeError) as error:
        raise ImportError(f"the compiled library {PATH} cannot be loaded ({error}): {_REMEDY}") from error
    if (found := loaded.digits_interface()) != INTERFACE:
        raise ImportError(f"the compiled library {PATH} has interface {found}, needed is {INTERFACE}: {_REMEDY}")
    return loaded


class Texts:
    """A column of a table that is text already: a comma after each of its `count` texts."""

    __slots__ = ("count", "padded")

    def __init__(self, text: bytes, count: int) -> None:
        self.padded, self.count = text + READ_BEHIND, count

    @property
    def text(self) -> bytes:
        """A copy of all of it."""
        return self.padded[: -len(READ_BEHIND)]

    @classmethod
    def of(cls, values: npt.NDArray[Any], *, point: bool = True) -> Texts:
        """Numbers with all their digits, (row,). Raises NonFiniteError."""
        text = in_full(np.ascontiguousarray(values))[1:-1] + b"," * bool(len(values))
        return cls(text if point else text.replace(b".0,", b","), len(values))


@dataclass(frozen=True, slots=True, eq=False)
class Rounded:
    """A column of a table, (row,), with so many decimals at most. `point`: a whole number is 1.0, not 1."""

    values: Array
    decimals: int
    point: bool = True


class _Room:
    """Memory to write to."""

    __slots__ = ("address", "bytes", "view")

    def __init__(self, size: int) -> None:
        self.view = memoryview(bytearray(size))
        self.address = ctypes.addressof(ctypes.c_char.from_buffer(self.view))
        self.bytes = size


class Writer:
    """Texts one after the other, in memory that the next writer gets again. Not to be used after `done`."""

    __slots__ = ("_room", "_size")

    def __init__(self) -> None:
        try:
            self._room = _rooms.pop()
        except IndexError:
            self._room = _Room(_FIRST_BYTES)
        self._size = 0

    def done(self) -> bytes:
        """All of it."""
        text = bytes(self._room.view[: self._size])
        if len(_rooms) < _KEPT_ROOMS and self._room.bytes <= _KEPT_BYTES:
            _rooms.append(self._room)
        return text

    def raw(self, text: bytes) -> None:
        """Bytes as they are."""
        self.room_for(len(text))
        self._room.view[self._size : self._size + len(text)] = text
        self._size += len(text)

    def column(self, values: Array, decimals: int) -> None:
        """[1.5,2.0] of shape (n,)."""
        flat = contiguous(values)
        at = self.room_for(flat.size * WIDEST)
        size = library().digits_list(address_of(flat), flat.size, decimals, at)
        if size < 0:
            self.raw(in_full(flat))
        else:
            self._size += size

    def rows(self, values: Array, decimals: int, counts: npt.NDArray[np.intp] | None = None) -> None:
        """[[1.5,2.0],[3.25]] of shape (row, n): of each row the first `counts[row]`, shape (row,), all without them."""
        rows, width = values.shape
        flat, own = contiguous(values), None if counts is None else np.ascontiguousarray(counts, dtype=np.int64)
        at = self.room_for(flat.size * WIDEST + 3 * rows)
        told = None if own is None else address_of(own)
        size = library().digits_lists(address_of(flat), rows, width, told, decimals, at)
        if size < 0:
            lists = [row[:count] for row, count in zip(flat, [width] * rows if own is None else own, strict=True)]
            self.raw(b"[%b]" % b",".join(map(in_full, lists)))
        else:
            self._size += size

    def table(self, columns: Sequence[Rounded | Texts], pieces: Sequence[bytes], rows: int) -> None:
        """A line for each row: the pieces with the columns between them, as many and one more.

        Raises ValueError for more than MOST_COLUMNS columns, for pieces that do not fit, and for columns that are not
        (rows,).
        """
        if len(columns) > MOST_COLUMNS or len(pieces) != len(columns) + 1:
            raise ValueError(f"{len(columns)} columns and {len(pieces)} pieces are no table")
        told, parts = (_Column * len(columns))(), (Piece * len(pieces))()
        kept = [_tell(column, place, rows) for column, place in zip(columns, told, strict=True)]
        for piece, part in zip(pieces, parts, strict=True):
            part.text, part.size = piece + READ_BEHIND, len(piece)
        at = self.room_for(rows * sum(map(len, pieces)) + sum(map(_most, columns)))
        size = library().digits_table(ctypes.addressof(told), ctypes.addressof(parts), len(columns), rows, at)
        del kept
        if size < 0:
            self.table([_as_texts(each) for each in columns], pieces, rows)
        else:
            self._size += size

    def room_for(self, more: int) -> int:
        """Where there is room for so many bytes more; `wrote` says how many of them there are then."""
        if (needed := self._size + more + _SLACK) > self._room.bytes:
            room = _Room(max(needed, 2 * self._room.bytes))
            room.view[: self._size] = self._room.view[: self._size]
            self._room = room
        return self._room.address + self._size

    def wrote(self, size: int) -> None:
        """So many bytes are at `room_for` now."""
        self._size += size


_rooms: list[_Room] = []


def list_text(values: Array, decimals: int) -> bytes:
    """`Writer.column` alone."""
    flat = np.ascontiguousarray(values, dtype=np.float64)
    try:
        room = _rooms.pop()
    except IndexError:
        room = _Room(_FIRST_BYTES)
    if (needed := flat.size * WIDEST + _SLACK) > room.bytes:
        room = _Room(needed)
    size = library().digits_list(address_of(flat), flat.size, decimals, room.address)
    text = in_full(flat) if size < 0 else bytes(room.view[:size])
    if len(_rooms) < _KEPT_ROOMS and room.bytes <= _KEPT_BYTES:
        _rooms.append(room)
    return text


def lists_text(values: Array, decimals: int, counts: npt.NDArray[np.intp] | None = None) -> bytes:
    """`Writer.rows` alone."""
    writer = Writer()
    writer.rows(values, decimals, counts)
    return writer.done()


def table_text(columns: Sequence[Rounded | Texts], pieces: Sequence[bytes], rows: int) -> bytes:
    """`Writer.table` alone."""
    writer = Writer()
    writer.table(columns, pieces, rows)
    return writer.done()


def _most(column: Rounded | Texts) -> int:
    """How many bytes it takes."""
    return len(column.padded) if isinstance(column, Texts) else column.values.size * WIDEST


def _tell(column: Rounded | Texts, at: _Column, rows: int) -> object:
    """Fills in what the library reads. What is returned must be kept until it has. Raises ValueError."""
    if isinstance(column, Texts):
        if column.count != rows:
            raise ValueError(f"a column of {column.count} texts is not one of {rows} rows")
        at.text = ctypes.cast(ctypes.c_char_p(column.padded), POINTER)
        return column
    flat = contiguous(column.values)
    if flat.shape != (rows,) or not 0 <= column.decimals <= MOST_DECIMALS:
        raise ValueError(f"a column of shape {flat.shape} with {column.decimals} decimals is not one of {rows} rows")
    at.values, at.decimals, at.point = address_of(flat), column.decimals, column.point
    return flat


def _as_texts(column: Rounded | Texts) -> Texts:
    """A column with all its digits."""
    return column if isinstance(column, Texts) else Texts.of(column.values, point=column.point)


def in_full(values: npt.NDArray[Any]) -> bytes:
    """A JSON list of numbers with all their digits. Raises NonFiniteError."""
    if not np.isfinite(values).all():
        raise NonFiniteError("a number is not finite: the answer was not sent")
    return orjson.dumps(values, option=orjson.OPT_SERIALIZE_NUMPY)


def checksum(array: npt.NDArray[Any], before: int) -> int:
    """`zlib.crc32` of a contiguous array's bytes behind others, of which it is `before`."""
    if array.nbytes >= _LONG_BYTES:
        found: int = library().digits_checksum(address_of(array), array.nbytes, before)
        if found >= 0:
            return found
    return zlib.crc32(array.data, before)


def contiguous(array: Array) -> Array:
    """The same numbers as float64 in one piece."""
    return np.ascontiguousarray(array, dtype=np.float64)


def address_of(array: npt.NDArray[Any]) -> int:
    """Where a contiguous array lies, which must be kept as long as that is used."""
    if array.flags.writeable and array.size:
        return ctypes.addressof(_Byte.from_buffer(array.data))  # three times as fast
    return int(array.ctypes.data)


_Byte = ctypes.c_char
