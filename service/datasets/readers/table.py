"""A table before anybody knows which of its columns are wanted: text and Parquet look the same from here on."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from service.datasets.columns import INPUTS, REQUIRED
from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject, warn

Array = npt.NDArray[np.float64]
Lines = npt.NDArray[np.int64]
Selection = slice | npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """A column of numbers (row,); `blank` (row,) says which cells have no value (nan there), None: all have one."""

    values: Array
    blank: npt.NDArray[np.bool_] | None = None

    def __getitem__(self, rows: Selection) -> Numbers:
        return Numbers(self.values[rows], None if self.blank is None else self.blank[rows])

    @property
    def is_absent(self) -> bool:
        """Whether no cell has a value."""
        return self.blank is not None and bool(self.blank.all())


@dataclass(frozen=True, slots=True, eq=False)
class Texts:
    """A column of texts: `codes` (row,) are indices into `values`, where "" is a cell without a value."""

    codes: npt.NDArray[np.int64]
    values: tuple[str, ...]

    @property
    def is_absent(self) -> bool:
        """Whether no cell has a value."""
        return not any(value.strip() for value in self.values)


class Table(Protocol):
    """Rows of a file. Only the columns that are asked for are read; the others may hold anything."""

    @property
    def file(self) -> str:
        """What the file is called in findings."""

    @property
    def names(self) -> tuple[str, ...] | None:
        """A name per column, "" for a column without one; None for a table without a header."""

    @property
    def width(self) -> int:
        """How many columns there are."""

    @property
    def lines(self) -> Lines:
        """1-based line of the file of each row, (row,)."""

    @property
    def noticed(self) -> Sequence[Finding]:
        """What was skipped or understood in a way that its author should know of."""

    def numbers(self, indices: Sequence[int], *, flags: Collection[int] = ()) -> list[Numbers]:
        """These columns; true and false are 1 and 0 in those of `flags`.

        Raises UnusableFileError with line and column of what is no number.
        """

    def texts(self, index: int) -> Texts:
        """One column as texts. Raises UnusableFileError."""


def numbers_if_any(table: Table, places: Mapping[str | int, int]) -> dict[str | int, Numbers]:
    """These columns by any name, but for those that are no numbers: they are only to be looked at, not to be used."""
    if not places:  # asking for no column parses the whole text all the same
        return {}
    try:
        return dict(zip(places, table.numbers(list(places.values())), strict=True))
    except UnusableFileError:
        found: dict[str | int, Numbers] = {}
        for name, index in places.items():
            with contextlib.suppress(UnusableFileError):
                found[name] = table.numbers([index])[0]
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """The rows of one run: canonical columns (row,), the line of each row, and what was noticed.

    With `zero_start` time and x are to be counted from the first row, unless something else is said of the start.
    """

    columns: Mapping[str, Array]
    lines: Lines
    findings: Sequence[Finding] = ()
    zero_start: bool = False


def samples_of(columns: Mapping[str, Numbers], lines: Lines, *, file: str, zero_start: bool = False) -> Samples:
    """The columns of one run by canonical name.

    A column that is not needed and has no value in the whole run is as if it were absent, with a warning. Raises
    UnusableFileError for any other cell without a value.
    """
    kept: dict[str, Array] = {}
    findings: list[Finding] = []
    for name, column in columns.items():
        without_numbers = name not in INPUTS and bool(np.isnan(column.values).all())
        if name not in REQUIRED and (column.is_absent or without_numbers):
            findings.append(warn(file, Code.EMPTY_COLUMN, "has no values, so it is as if absent", column=name))
        else:
            kept[name] = column.values
    gaps = [gap for name in kept for gap in gaps_in(columns[name].blank, lines, file=file, column=name)]
    if gaps:
        raise UnusableFileError(gaps[:MAX_LOCATED])
    return Samples(kept, lines, findings, zero_start)


def gaps_in(blank: npt.NDArray[np.bool_] | None, lines: Lines, *, file: str, column: str) -> Iterator[Finding]:
    """A rejection for each of the first cells without a value; `blank` and `lines` are (row,)."""
    if blank is not None:
        for at in np.flatnonzero(blank)[:MAX_LOCATED].tolist():
            yield reject(file, Code.EMPTY_CELL, "no value in this cell", row=int(lines[at]), column=column)
