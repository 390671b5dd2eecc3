"""Rows of delimited numbers as columns: a fast path for clean text, and a careful one that says what is wrong.

The careful path is the definition; the fast one (Arrow's CSV parser) is used where it cannot differ.
"""

from __future__ import annotations

import io
import re
from array import array
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa
from pyarrow import csv

from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject

# What C runtimes print for values that are not finite: nan, -nan(ind), 1.#QNAN, -1.#IND, 1.#INF
_NOT_FINITE = re.compile(rb"[+-]?(nan(\([\w]*\))?|1\.#(qnan|snan|ind|inf)\w*)", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """`columns[i]` float64 (row,) without the empty column that trailing delimiters make; `lines` (row,)."""

    columns: tuple[npt.NDArray[np.float64], ...]
    lines: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Place:
    """Names the places of one file in findings: its name and the labels of its columns, where known."""

    file: str
    labels: Sequence[str]

    def column(self, index: int) -> str:
        label = self.labels[index] if index < len(self.labels) else ""
        return label or f"#{index}"


def parse_grid(
    body: bytes,
    delimiter: bytes,
    lines: npt.NDArray[np.int64],
    *,
    file: str = "file",
    labels: Sequence[str] = (),
) -> Grid:
    """Parse rows that contain no blank or comment line; `lines` (row,) says where each one stood.

    Raises UnusableFileError with line and column (its label, or #index) of ragged rows, empty cells and text.
    """
    grid = _fast(body, delimiter, lines)
    return grid if grid is not None else _careful(body, delimiter, lines, _Place(file, labels))


def _fast(body: bytes, delimiter: bytes, lines: npt.NDArray[np.int64]) -> Grid | None:
    """Arrow's parser; None when it sees anything unusual."""
    width = body.split(b"\n", 1)[0].count(delimiter) + 1
    names = [f"c{i}" for i in range(width)]
    try:
        table = csv.read_csv(
            io.BytesIO(body),
            read_options=csv.ReadOptions(column_names=names, use_threads=False),
            parse_options=csv.ParseOptions(delimiter=delimiter.decode(), quote_char=False),
            convert_options=csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.float64()), null_values=[""], check_utf8=False
            ),
        )
    except pa.ArrowInvalid:
        return None
    columns = table.columns
    if width > 1 and columns[-1].null_count == table.num_rows:
        columns = columns[:-1]
    if table.num_rows != len(lines) or any(column.null_count for column in columns):
        return None
    return Grid(tuple(column.to_numpy() for column in columns), lines)


def _careful(body: bytes, delimiter: bytes, lines: npt.NDArray[np.int64], place: _Place) -> Grid:
    """Row by row in Python: slower, knows where each fault is."""
    rows = body.split(b"\n")
    width = rows[0].count(delimiter) + 1
    # the last row may be cut off, and then ends in a value
    tail = width > 1 and all(not row.rpartition(delimiter)[2].strip() for row in (rows[:-1] or rows))
    values, problems = array("d"), list[Finding]()
    for row, line in zip(rows, lines.tolist(), strict=True):
        cells = row.split(delimiter)
        if len(cells) != width or (tail and cells[-1].strip()):
            problems.append(_ragged(len(cells) - (tail and not cells[-1].strip()), width - tail, line, place))
        else:
            for index in range(width - tail):
                try:
                    values.append(number(cells[index]))
                except ValueError:
                    problems.append(_bad_cell(cells[index], index, line, place))
        if len(problems) >= MAX_LOCATED:
            break
    if problems:
        raise UnusableFileError(problems[:MAX_LOCATED])
    matrix = np.frombuffer(values, dtype=np.float64).reshape(len(rows), width - tail)
    return Grid(tuple(np.ascontiguousarray(column) for column in matrix.T), lines)


def number(cell: bytes) -> float:
    """A cell as float; raises ValueError. Python's own `1_000` is not a number here."""
    text = cell.strip()
    if _NOT_FINITE.fullmatch(text):
        return float("nan")
    if b"_" in text:
        raise ValueError(text)
    return float(text)


def _ragged(count: int, width: int, line: int, place: _Place) -> Finding:
    message = f"{count} values, the first row has {width}"
    if count < width:
        message += "; if the simulation was stopped while writing, delete the unfinished last line"
    return reject(place.file, Code.RAGGED_ROW, message, row=line, column=place.column(min(count, width)))


def _bad_cell(cell: bytes, index: int, line: int, place: _Place) -> Finding:
    text = cell.strip()
    if not text:
        return reject(place.file, Code.EMPTY_CELL, "no value in this cell", row=line, column=place.column(index))
    message = f"{text[:40].decode('utf-8', 'replace')!r} is not a number"
    if b"," in text:
        message += "; write decimals with a point"
    return reject(place.file, Code.NOT_A_NUMBER, message, row=line, column=place.column(index))
