"""Text as rows of cells: every file that people and programs write as lines is taken apart here and nowhere else.

Run files, long tables and runs.csv come through the same door. What Chrono and its demos write: `ChWriterCSV` puts the
delimiter after *every* value, a header is optional free text, delimiters are `,` `;` tab or spaces. What Excel writes:
a first line `sep=;`, rows of delimiters only, cells in quotes, Windows-1252.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from service.datasets.columns import MAX_COLUMNS, meaning_of
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.readers.decimal_comma import is_with_comma
from service.datasets.readers.foreign import unsupported
from service.datasets.readers.numbers import is_number
from service.datasets.readers.sniff import HEAD_BYTES
from service.datasets.readers.table import Lines
from service.datasets.readers.text_preamble import COMMENTS, NOTHING, preamble_of

_TEXT_MEANINGS = {"run", "set", "file"}

# first bytes of lines that may hold no data: blank, comments, delimiters only, or with leading space
_NOISE = np.frombuffer(b"\n \t#/%!,;|\"'", dtype=np.uint8)
_SEP_LINE = re.compile(rb'\A"?sep=(?P<mark>[^\n"]|\\t)"?(?P=mark)*[ ]*\n', re.IGNORECASE)
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_END_OF_DOS = b"\x1a"
"""What DOS programs write behind the last line."""
_DELIMITERS = (";", "\t", "|", ",")
_OPEN_CELL = re.compile(rb'[,;|\t]"[^"]*$')
_SPACED_QUOTE = re.compile(rb"(?<=[,;|\t]) +(?=[\"'])")


@dataclass(frozen=True, slots=True, eq=False)
class SplitText:
    """A text without blank lines and comments: rows of cells in `body`, the line of each in `lines` (row,).

    `header` is the line above the rows, if any, `comments` are lines that begin as such, each with its number; `quote`
    is "" where no cell is in quotes.
    """

    body: bytes
    delimiter: str
    quote: str
    lines: Lines
    header: str | None
    comments: tuple[tuple[int, str], ...]
    noticed: tuple[Finding, ...]

    @property
    def first(self) -> list[str]:
        """The cells of the first row."""
        return split_row(self.body.split(b"\n", 1)[0].decode(), self.delimiter, self.quote)

    def rows(self) -> Iterator[list[str]]:
        """The cells of each row."""
        for row in self.body.split(b"\n"):
            yield split_row(row.decode(), self.delimiter, self.quote)


def split_row(row: str, delimiter: str, quote: str = '"') -> list[str]:
    """The cells of one line. A quote counts at the start of a cell only."""
    if delimiter == " ":
        row = " ".join(row.split())
    if not quote or quote not in row:
        return row.split(delimiter)
    try:
        return next(csv.reader([row], delimiter=delimiter, quotechar=quote, skipinitialspace=True), [""])
    except csv.Error:  # a cell of 100,000 characters
        return row.split(delimiter)


def split_text(data: bytes, *, file: str = "file", max_rows: int) -> SplitText:
    """Rows and header of a text. Raises UnusableFileError for what is no text, empty or too large."""
    text, noticed = _plain(data, file)
    asked = _SEP_LINE.match(text)
    text = text if asked is None else b"\n" + text[asked.end() :]
    text, numbers = _joined(text)
    above = preamble_of(text, file)
    header, comments, count = above.header, above.comments, above.count
    noticed += above.noticed if numbers is None else [_at(numbers, each) for each in above.noticed]
    body = text[above.position :].rstrip(b"\n")
    if body.count(b"\n") >= max_rows + 1:
        message = f"more than {max_rows} rows, allowed is at most {max_rows}"
        raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])
    lines = np.arange(count + 1, count + 2 + body.count(b"\n"), dtype=np.int64)
    mark = asked["mark"].decode().replace("\\t", "\t") if asked else None
    body, kept, delimiter, skipped = _data_rows(body, header, mark)
    if not kept.any():
        marked = len(comments) + len(skipped)
        message = "no rows of numbers in it" + (f"; {marked} lines begin as comments do" if marked else "")
        raise UnusableFileError([reject(file, Code.EMPTY_FILE, message), *noticed])
    lines = lines[kept]
    comments = [*comments, *((count + 1 + at, line) for at, line in skipped)]
    if numbers is not None:
        lines, comments = numbers[lines - 1], [(int(numbers[at - 1]), line) for at, line in comments]
    first = body.split(b"\n", 1)[0].decode()
    _bound_columns(first, delimiter, int(lines[0]), file)
    quote = '"' if b'"' in body else _single_quote(first, delimiter)
    if delimiter == " ":
        body = b"\n".join(b" ".join(line.split()) for line in body.split(b"\n"))
    elif quote:
        body = _SPACED_QUOTE.sub(b"", body)
    return SplitText(body, delimiter, quote, lines, header, tuple(comments), tuple(noticed))


def whole_lines(start: bytes) -> bytes:
    """The beginning of a file without its last, unfinished line."""
    end = start.rfind(b"\n")
    return start[: end - end % 2 if start.startswith(_UTF16) else end]


def _plain(data: bytes, file: str) -> tuple[bytes, list[Finding]]:
    """UTF-8 without byte-order mark, with newlines as line ends; refuses what is no text."""
    foreign = unsupported(data[:HEAD_BYTES], file)
    if foreign is not None:
        raise UnusableFileError([foreign])
    data, noticed = _as_utf8(data, file)
    if b"\0" in data:
        message = (
            "binary content, or UTF-16 without a byte-order mark; expected plain text with one row per line (UTF-8 or "
            "ASCII)"
        )
        raise UnusableFileError([reject(file, Code.NOT_TEXT, message)])
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data, noticed


def _as_utf8(data: bytes, file: str) -> tuple[bytes, list[Finding]]:
    """Text in UTF-8, UTF-16 with its mark or Windows-1252 as UTF-8 without a mark."""
    if data.startswith(_UTF16) and not data.startswith(codecs.BOM_UTF32_LE):
        try:
            text = data.decode("utf-16")
        except UnicodeDecodeError as error:
            message = f"begins as UTF-16 does, but is not ({error.reason}); save it as UTF-8"
            raise UnusableFileError([reject(file, Code.NOT_TEXT, message)]) from error
        return text.encode(), [warn(file, Code.ENCODING, "is UTF-16 and read as such")]
    data = data.removeprefix(codecs.BOM_UTF8).removesuffix(_END_OF_DOS)
    try:
        if not data.isascii():
            data.decode()
    except UnicodeDecodeError:
        message = "is not UTF-8, so it is read as Windows-1252; look at names that have other letters than a to z"
        text = data.decode("cp1252", "replace")
        return text.encode(), [warn(file, Code.ENCODING, message)]
    return data, []


def _joined(text: bytes) -> tuple[bytes, Lines | None]:
    """The text with every row on one line, and the line on which each one began; None where no row has several.

    A cell in quotes may go on over lines. Where quotes do not come in pairs no line is joined to another.
    """
    last = text.rfind(b'"')
    if last < 0:
        return text, None
    # beyond the line of the last quote nothing is open: a header in quotes costs no look at the rows
    characters = np.frombuffer(text[: text.find(b"\n", last) + 1] or text, dtype=np.uint8)
    quotes = np.cumsum(characters == ord('"'))[characters == ord("\n")]
    if not (np.diff(quotes, prepend=0) % 2).any():
        return text, None
    rows, numbers, open_row = list[bytes](), list[int](), False
    for number, line in enumerate(text.split(b"\n"), start=1):
        if open_row:
            rows[-1] += b" " + line
        else:
            rows.append(line)
            numbers.append(number)
        # in a comment a quote may mean inches, unless it begins a cell
        if open_row or not line.lstrip().decode().startswith(COMMENTS) or _OPEN_CELL.search(line):
            open_row ^= line.count(b'"') % 2 == 1
    return (text, None) if open_row else (b"\n".join(rows), np.array(numbers, dtype=np.int64))


def _at(numbers: Lines, finding: Finding) -> Finding:
    """The finding with the line of the file, where rows go over several."""
    return finding if finding.row is None else replace(finding, row=int(numbers[finding.row - 1]))


Skipped = list[tuple[int, str]]


def _data_rows(body: bytes, header: str | None, mark: str | None) -> tuple[bytes, npt.NDArray[np.bool_], str, Skipped]:
    """(rows without blank lines and comments, which lines they are, their delimiter, comments with their indices)."""
    characters = np.frombuffer(body, dtype=np.uint8)
    starts = np.concatenate([[0], np.flatnonzero(characters == ord("\n")) + 1])
    if len(body) and not np.isin(characters[starts[starts < len(body)]], _NOISE).any():
        return body, np.ones(len(starts), dtype=np.bool_), _delimiter(body, header, mark), []
    nothing = NOTHING + (mark or "")
    every = [line.decode() for line in body.split(b"\n")]
    filled = [(at, line) for at, line in enumerate(every) if line.strip(nothing)]
    plain = next((line for _, line in filled if not line.lstrip().startswith(COMMENTS)), None)
    delimiter = _delimiter((plain or header or "").encode(), header, mark)
    is_row = _row_test(plain, header, delimiter)
    rows: list[str] = []
    skipped: Skipped = []
    kept = np.zeros(len(every), dtype=np.bool_)
    for at, line in filled:
        if line.lstrip().startswith(COMMENTS) and not is_row(line):
            skipped.append((at, line.strip()))
        else:
            # a leading tab would be an empty first cell, so tabs before a value stay
            rows.append(line.lstrip(" "))
            kept[at] = True
    return "\n".join(rows).encode(), kept, delimiter, skipped


def _row_test(plain: str | None, header: str | None, delimiter: str) -> _RowTest:
    """Whether a line that begins as comments do is a row: its first column holds texts, and it has all of its cells."""
    reference = plain if plain is not None else header
    if reference is None:
        return _RowTest((0, 0), delimiter)
    first = split_row(header, delimiter)[0] if header is not None else ""
    holds_texts = meaning_of(first) in _TEXT_MEANINGS or plain is None or not is_number(split_row(plain, delimiter)[0])
    widths = _widths(reference, delimiter)
    return _RowTest(widths if holds_texts else (0, 0), delimiter)


@dataclass(frozen=True, slots=True)
class _RowTest:
    widths: tuple[int, int]
    delimiter: str

    def __call__(self, line: str) -> bool:
        cells, filled = _widths(line, self.delimiter)
        return self.widths[0] > 0 and (cells == self.widths[0] or filled == self.widths[1])


def _widths(row: str, delimiter: str) -> tuple[int, int]:
    """How many cells, and how many up to the last one that has something in it."""
    cells = split_row(row.strip(" "), delimiter)
    return len(cells), max((at for at, cell in enumerate(cells, start=1) if cell.strip()), default=0)


def _delimiter(body: bytes, header: str | None, mark: str | None) -> str:
    """By the first row: one that gives it as many cells as the header, where there is one.

    Else one that makes cells with decimal commas; else `;` before `,`.
    """
    if mark is not None:
        return mark
    row = body.split(b"\n", 1)[0].decode()
    if header is not None:
        widths = {mark: (_widths(row, mark), _widths(header, mark)) for mark in _DELIMITERS}
        alike = [
            mark for mark, (one, other) in widths.items() if one[1] > 1 and (one[0] == other[0] or one[1] == other[1])
        ]
        if alike:
            return max(alike, key=lambda mark: widths[mark][0][1])
        cells = split_row(row, " ")
        if len(cells) == len(split_row(header, " ")) > 1 and not any(cell.endswith(_DELIMITERS) for cell in cells):
            return " "
    around = [mark for mark in (";", "|", "\t", " ") if _makes_decimals(split_row(row, mark))]
    if around:
        return around[0]
    bare = re.sub(r'"[^"]*"', "", row)
    return next((mark for mark in (";", ",", "|") if mark in bare), "\t" if _is_tabbed(bare) else " ")


def _makes_decimals(cells: Sequence[str]) -> bool:
    """Whether two of these cells or more are numbers with one comma, and no other one has a comma or a point."""
    filled = [cell.strip("\"' ") for cell in cells if cell.strip("\"' ")]
    others = [cell for cell in filled if not is_with_comma(cell)]
    return len(filled) - len(others) > 1 and not any(
        "," in cell or (is_number(cell) and "." in cell) for cell in others
    )


def _is_tabbed(row: str) -> bool:
    """Tabs that separate: not merely a stray one in a row of values separated by spaces."""
    return "\t" in row and all(" " not in cell.strip() for cell in row.split("\t"))


def _single_quote(first: str, delimiter: str) -> str:
    cells = [cell.strip() for cell in split_row(first, delimiter, "")]
    return "'" if any(len(cell) > 1 and cell[0] == cell[-1] == "'" for cell in cells) else ""


def _bound_columns(first: str, delimiter: str, line: int, file: str) -> None:
    width = len(split_row(first, delimiter, ""))
    if width > MAX_COLUMNS + 1:  # one more: the empty column after a trailing delimiter
        message = f"{width} columns, allowed are at most {MAX_COLUMNS}"
        raise UnusableFileError([reject(file, Code.TOO_LARGE, message, row=line)])
