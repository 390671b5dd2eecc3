"""Numbers as text. NaN and infinity never pass.

What is computed for each time is written to 1e-7 of its unit, a thousandth of what runs of one scenario scatter; the
forms in binary have all of it. What was asked for, and numbers that stand alone, are the shortest decimals that read
back as the same float64.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import orjson

from service.physics.scenario import Array
from service.twin import NonFiniteError
from service.twin.kept import kept
from service.wire.digits import Rounded, Texts, list_text, lists_text, table_text
from service.wire.lines import Cells, Lists

DECIMALS = 7
"""Of a column that is computed."""

_AS_ASKED = frozenset({"time_s", "torque_nm"})
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


def is_rounded(name: str, values: npt.NDArray[Any]) -> bool:
    """Whether a column is written to DECIMALS: what is computed is, neither what was asked for nor true and false."""
    return values.dtype == np.float64 and name not in _AS_ASKED


def column_text(name: str, values: npt.NDArray[Any]) -> orjson.Fragment:
    """`column_list` for orjson."""
    return orjson.Fragment(column_list(name, values))


def column_list(name: str, values: npt.NDArray[Any]) -> bytes:
    """A column (time,) of an answer as a JSON list. Raises NonFiniteError."""
    if name == "time_s":
        return _times_list(values)
    if _is_decimal(name, values):
        return list_text(values, DECIMALS)
    return dump(np.ascontiguousarray(values))


def columns_text(name: str, values: npt.NDArray[Any], counts: npt.NDArray[np.intp]) -> orjson.Fragment:
    """A column (row, time) as a JSON list of lists: of each row its first `counts`, (row,). Raises NonFiniteError."""
    return orjson.Fragment(_lists(name, values, counts))


def column_of_lines(name: str, values: npt.NDArray[Any], counts: npt.NDArray[np.intp]) -> Lists | Cells:
    """A column (row, time), of which each line has its row: the first `counts`, (row,). Raises NonFiniteError."""
    if _is_decimal(name, values):
        return Lists(values, counts, DECIMALS)
    return Cells.of([b"[%b]" % row for row in _lists(name, values, counts)[2:-2].split(b"],[")])


def _lists(name: str, values: npt.NDArray[Any], counts: npt.NDArray[np.intp]) -> bytes:
    whole = (counts == values.shape[1]).all()
    if _is_decimal(name, values):
        return lists_text(values, DECIMALS, None if whole else counts)
    rows = np.ascontiguousarray(values)
    return dump(rows if whole else [row[:count] for row, count in zip(rows, counts.tolist(), strict=True)])


def table_column(name: str, values: npt.NDArray[Any], *, point: bool = True) -> Rounded | Texts:
    """A column (time,) as one of a table; true is 1, false 0. Whole numbers are 1.0, or 1 without `point`.

    Raises NonFiniteError, or who writes the table does.
    """
    if name == "time_s" and point:
        return times_texts(values)
    if _is_decimal(name, values):
        return Rounded(values, DECIMALS, point)
    return Texts.of(values.astype(np.int64) if values.dtype == np.bool_ else values, point=point)


def _is_decimal(name: str, values: npt.NDArray[Any]) -> bool:
    """Whether DECIMALS are the digits of a column: it is rounded, or it has no more of them."""
    if is_rounded(name, values):
        return True
    # the shortest decimal of such a number: with so few digits there is one alone that reads back as it
    return values.dtype == np.float64 and bool((np.rint(values * 10.0**DECIMALS) / 10.0**DECIMALS == values).all())


@kept
def times_texts(times: Array) -> Texts:
    """Times with all their digits."""
    return _texts(times, point=True)


@kept
def _times_list(times: Array) -> bytes:
    """The same as a JSON list."""
    return b"[%b]" % times_texts(times).text[:-1]


@kept
def codes_texts(codes: Array) -> Texts:
    """The same, whole numbers without a point."""
    return _texts(codes, point=False)


def _texts(times: Array, *, point: bool) -> Texts:
    if not _is_decimal("time_s", times):
        return Texts.of(times, point=point)
    return Texts(table_text([Rounded(times, DECIMALS, point)], [b"", b","], len(times)), len(times))


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


def require_finite_tables(tables: Mapping[str, Mapping[str, Any]], where: str) -> None:
    """The same for groups of columns that are arrays, or lists with an entry for each row."""
    for group, columns in tables.items():
        require_finite_columns({name: _numbers_in(column) for name, column in columns.items()}, f"{where}.{group}")


def _numbers_in(column: npt.NDArray[Any] | Sequence[Any]) -> npt.NDArray[Any]:
    if isinstance(column, np.ndarray):
        return column
    return np.array([each for each in column if type(each) is float], dtype=np.float64)


def _place_of_fault(value: object) -> str | None:
    """Where inside the value something is not finite; empty if it is the value itself, None if nothing is."""
    kind = type(value)
    if kind in _NO_NUMBERS or isinstance(value, str):
        return None
    if isinstance(value, float):
        return None if math.isfinite(value) else ""
    if names := getattr(kind, "__dataclass_fields__", None):
        return _first_fault([(name, getattr(value, name)) for name in names], ".{}")
    if isinstance(value, np.ndarray):
        return None if np.isfinite(value).all() else ""
    if isinstance(value, Mapping):
        return _first_fault(value.items(), ".{}")
    if isinstance(value, list | tuple):
        return _first_fault(enumerate(value), "[{}]")
    return None


def _first_fault(members: Iterable[tuple[object, object]], step: str) -> str | None:
    for name, member in members:
        if type(member) is float and math.isfinite(member):  # most are
            continue
        place = _place_of_fault(member)
        if place is not None:
            return step.format(name) + place
    return None
