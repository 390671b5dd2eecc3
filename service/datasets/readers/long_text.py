"""A long table as text: numbers in most columns, texts in `run` and `set`."""

from __future__ import annotations

import csv as python_csv
import io
from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa
from pyarrow import csv

from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject
from service.datasets.readers.chrono_text import SplitText, TextTable
from service.datasets.readers.long_table import TEXT_LABELS, LongTable, Texts, label_of
from service.datasets.readers.number_grid import number


def row_width(text: SplitText) -> int:
    """Cells of the first row, without the empty one after a trailing delimiter."""
    cells = _cells(text.body.split(b"\n", 1)[0].decode("utf-8", "replace"), text.delimiter.decode())
    return len(cells) - (len(cells) > 1 and not cells[-1].strip())


def parse_long_text(text: SplitText, names: Sequence[str], *, file: str = "file") -> LongTable:
    """The rows of `text`, whose header is `names`. Raises UnusableFileError with line and column of what is wrong."""
    labels = [label_of(name) for name in names]
    columns = _read(text, names, [label in TEXT_LABELS for label in labels], file)
    numbers = {label: column.to_numpy() for label, column in zip(labels, columns, strict=True)
               if label and label not in TEXT_LABELS}  # fmt: skip
    texts = {label: _texts(column) for label, column in zip(labels, columns, strict=True) if label in TEXT_LABELS}
    kept = [index for index, label in enumerate(labels) if label is None]
    table = TextTable(tuple(names[i] for i in kept), tuple(columns[i].to_numpy() for i in kept), text.lines)
    return LongTable(table, numbers, texts)


def _texts(column: pa.ChunkedArray) -> Texts:
    encoded = column.combine_chunks().dictionary_encode()
    return Texts(encoded.indices.to_numpy().astype(np.int64), tuple(encoded.dictionary.to_pylist()))


def _read(text: SplitText, names: Sequence[str], is_text: Sequence[bool], file: str) -> list[pa.ChunkedArray]:
    """Arrow's parser; where it sees anything unusual, a search for what that is."""
    first = text.body.split(b"\n", 1)[0].decode("utf-8", "replace")
    width = len(_cells(first, text.delimiter.decode()))
    keys = [f"c{index}" for index in range(width)]
    types = {key: pa.string() if wanted else pa.float64() for key, wanted in zip(keys, is_text, strict=False)}
    try:
        table = csv.read_csv(
            io.BytesIO(text.body),
            read_options=csv.ReadOptions(column_names=keys, use_threads=False),
            parse_options=csv.ParseOptions(delimiter=text.delimiter.decode(), quote_char='"'),
            convert_options=csv.ConvertOptions(
                column_types={key: types.get(key, pa.string()) for key in keys}, null_values=[""]
            ),
        )
    except pa.ArrowInvalid as error:
        faults = list(_faults(text, names, is_text, width, file))
        raise UnusableFileError(faults or [reject(file, Code.NOT_A_NUMBER, f"cannot be read: {error}")]) from error
    columns = table.columns[: len(names)]
    whole = table.num_rows == len(text.lines)
    if not whole or any(column.null_count for column in columns):
        faults = list(_faults(text, names, is_text, width, file))
        raise UnusableFileError(faults or [reject(file, Code.RAGGED_ROW, "has cells that go over several lines")])
    return list(columns)


def _faults(text: SplitText, names: Sequence[str], is_text: Sequence[bool], width: int, file: str) -> Iterator[Finding]:
    """The first faults, row by row: slower, and only where there is one."""
    found = 0
    delimiter = text.delimiter.decode()
    for row, line in zip(text.body.split(b"\n"), text.lines.tolist(), strict=True):
        cells = _cells(row.decode("utf-8", "replace"), delimiter)
        if len(cells) != width:
            message = f"{len(cells)} values, the first row has {width}"
            yield reject(file, Code.RAGGED_ROW, message, row=line)
            found += 1
            continue
        for name, cell, texts in zip(names, cells, is_text, strict=False):
            problem = None if texts and cell.strip() else _problem(cell)
            if problem is not None:
                yield reject(file, *problem, row=line, column=name)
                found += 1
        if found >= MAX_LOCATED:
            return


def _cells(row: str, delimiter: str) -> list[str]:
    try:
        return next(python_csv.reader([row], delimiter=delimiter), [""])
    except python_csv.Error:
        return [row]


def _problem(cell: str) -> tuple[Code, str] | None:
    if not cell.strip():
        return Code.EMPTY_CELL, "no value in this cell"
    try:
        number(cell.encode())
    except ValueError:
        return Code.NOT_A_NUMBER, f"{cell[:40]!r} is not a number"
    return None
