"""One text file of a Chrono simulation as arrays, whatever its delimiter, header, blank lines or comments.

What Chrono and its demos write: `ChWriterCSV` puts the delimiter after *every* value, a header is optional
free text, delimiters are `,` `;` tab or spaces. The names of columns are resolved elsewhere (`column_map`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from service.datasets.columns import MAX_COLUMNS
from service.datasets.findings import Code, UnusableFileError, reject
from service.datasets.readers.number_grid import parse_grid
from service.datasets.readers.source import DEFAULT_MAX_BYTES, read_bounded
from service.datasets.run import MAX_ROWS_PER_RUN

COMMENTS = (b"#", b"//", b"%", b"!")

# first bytes of lines that hold no data, or have leading space
_NOISE = np.frombuffer(b"\n \t#/%!", dtype=np.uint8)
_SEPARATORS = re.compile(rb"[,;\s]+")


@dataclass(frozen=True, slots=True, eq=False)
class TextTable:
    """Columns of one file: `columns[i]` is float64 (row,); `lines` (row,) are 1-based lines of the file."""

    names: tuple[str, ...] | None
    columns: tuple[npt.NDArray[np.float64], ...]
    lines: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class SplitText:
    """A text without blank and comment lines: rows of cells in `body`, the line of each in `lines` (row,)."""

    body: bytes
    delimiter: bytes
    lines: npt.NDArray[np.int64]
    header: bytes | None
    comment: bytes | None


def read_text(stream: BinaryIO, *, file: str = "file", max_bytes: int = DEFAULT_MAX_BYTES) -> TextTable:
    """Read a whole file, plain or gzipped. Cells may be `nan` or `inf`: validation says so, not this reader.

    Raises UnusableFileError with file, line and column of what cannot be read as a table of numbers.
    """
    return parse_text(read_bounded(stream, file=file, max_bytes=max_bytes), file=file)


def parse_text(data: bytes, *, file: str = "file") -> TextTable:
    """The same for bytes that are already decompressed."""
    text = split_text(data, file=file)
    if text.delimiter == b" ":
        text = replace(text, body=b"\n".join(b" ".join(line.split()) for line in text.body.split(b"\n")))
    labels = [cell.strip().decode("utf-8", "replace") for cell in (text.header or b"").split(text.delimiter)]
    grid = parse_grid(text.body, text.delimiter, text.lines, file=file, labels=labels)
    return TextTable(header_names(text, len(grid.columns), file=file), grid.columns, grid.lines)


def split_text(data: bytes, *, file: str = "file", max_rows: int = MAX_ROWS_PER_RUN) -> SplitText:
    """Rows, header and comment of a text. Raises UnusableFileError for what is no text, empty or too large."""
    text = _plain(data, file)
    body, first_line, header, comment = _split_preamble(text)
    if body.count(b"\n") >= max_rows + 1:
        message = f"more than {max_rows} rows, allowed is at most {max_rows}"
        raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])
    if not body.strip():
        raise UnusableFileError([reject(file, Code.EMPTY_FILE, "no rows of numbers in it")])
    body, lines = _data_lines(body, first_line)
    delimiter = _delimiter(body)
    _bound_columns(body, delimiter, first_line, file)
    return SplitText(body, delimiter, lines, header, comment)


def _plain(data: bytes, file: str) -> bytes:
    """Without byte-order mark, with newlines as line ends; refuses what is no text."""
    if b"\0" in data or data.startswith((b"\xff\xfe", b"\xfe\xff")):
        message = "binary or UTF-16 content; expected plain text with one row per line (UTF-8 or ASCII)"
        raise UnusableFileError([reject(file, Code.NOT_TEXT, message)])
    data = data.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def _split_preamble(text: bytes) -> tuple[bytes, int, bytes | None, bytes | None]:
    """(rows of numbers, 1-based line of the first one, header line, last comment line before the rows)."""
    header = comment = None
    position, line_number = 0, 0
    while position < len(text):
        end = text.find(b"\n", position)
        end = len(text) if end < 0 else end
        line, line_number = text[position:end].strip(), line_number + 1
        if line.startswith(COMMENTS):
            comment = line
        elif line:
            if header is not None or not _is_header(line):
                return text[position:], line_number, header, comment
            header = line
        position = end + 1
    return b"", line_number, header, comment


def _is_header(line: bytes) -> bool:
    """Fewer than half of the cells are numbers. (One bad cell in the first row does not make it a header.)"""
    cells = [cell for cell in _SEPARATORS.split(line) if cell]
    return sum(_is_number(cell) for cell in cells) * 2 < len(cells)


def _is_number(cell: bytes) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _data_lines(body: bytes, first_line: int) -> tuple[bytes, npt.NDArray[np.int64]]:
    """The rows without blank and comment lines, and the line of the file that each one came from."""
    body = body.rstrip(b"\n")
    characters = np.frombuffer(body, dtype=np.uint8)
    starts = np.flatnonzero(characters == ord("\n")) + 1
    if not np.isin(characters[starts], _NOISE).any():
        return body, np.arange(len(starts) + 1, dtype=np.int64) + first_line
    kept: list[bytes] = []
    numbers: list[int] = []
    for number, line in enumerate(body.split(b"\n"), start=first_line):
        # leading space only: a trailing tab is a trailing delimiter
        bare = line.lstrip()
        if bare and not bare.startswith(COMMENTS):
            # a leading tab would be an empty first cell, so tabs before a value stay
            kept.append(line.lstrip(b" "))
            numbers.append(number)
    return b"\n".join(kept), np.array(numbers, dtype=np.int64)


def _delimiter(body: bytes) -> bytes:
    """By the first row. `;` before `,`: where both occur the comma is a decimal comma, which is refused later."""
    row = body.split(b"\n", 1)[0]
    return next((mark for mark in (b";", b",") if mark in row), b"\t" if _is_tabbed(row) else b" ")


def _is_tabbed(row: bytes) -> bool:
    """Tabs that separate: not merely a stray one in a row of values separated by spaces."""
    return b"\t" in row and all(b" " not in cell.strip() for cell in row.split(b"\t"))


def _bound_columns(body: bytes, delimiter: bytes, first_line: int, file: str) -> None:
    width = body.split(b"\n", 1)[0].count(delimiter) + 1
    if width > MAX_COLUMNS + 1:  # one more: the empty column after a trailing delimiter
        message = f"{width} columns, allowed are at most {MAX_COLUMNS}"
        raise UnusableFileError([reject(file, Code.TOO_LARGE, message, row=first_line)])


def header_names(text: SplitText, width: int, *, file: str = "file") -> tuple[str, ...] | None:
    """Header cells, one per column. The header may use another delimiter than the rows: it is free text.

    A comment right above the rows (as numpy.savetxt writes) serves as header when its cells fit one to one.
    Raises UnusableFileError when there is a header that does not name `width` columns.
    """
    header, delimiter = text.header, text.delimiter
    line = header if header is not None else text.comment
    if line is None:
        return None
    if header is None:
        line = line.lstrip(b"#/%! \t")
    for mark in (delimiter, b",", b";", b"\t", None):
        cells = [cell.strip() for cell in line.split(b" " if mark == b" " else mark)]
        cells = [cell for cell in cells if cell] if mark in (b" ", None) else cells
        while cells and not cells[-1]:
            cells.pop()
        if len(cells) == width and (header is not None or _is_header(b" ".join(cells))):
            return tuple(cell.decode("utf-8", "replace").strip("\"' ") for cell in cells)
    if header is None:
        return None
    message = f"the header {header[:120].decode('utf-8', 'replace')!r} does not name the {width} columns of the rows"
    raise UnusableFileError([reject(file, Code.HEADER_MISMATCH, message, row=int(text.lines[0]))])
