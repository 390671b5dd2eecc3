"""The names of a text's columns: from its header, or from a comment right above the rows."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from service.datasets.columns import REQUIRED, meaning_of, unquoted
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.readers.numbers import is_number, number
from service.datasets.readers.text_lines import SplitText, split_row
from service.datasets.readers.text_preamble import is_header

_SHOWN = 5
_THOUSANDS = re.compile(r" *[1-9][0-9]{0,2},[0-9]{3} *")
_ROW_NAMES = ("", "index", "no", "nr", "row", "id", "#")
_FEW = 10


@dataclass(frozen=True, slots=True)
class Header:
    """`names` (None: no header), one for each of `width` columns, "" where a column has none."""

    names: tuple[str, ...] | None
    width: int
    noticed: tuple[Finding, ...]


def header_of(text: SplitText, *, file: str = "file") -> Header:
    """The header over the rows. It may use another delimiter than they do: it is free text.

    Columns at the end that have neither name nor value do not count: trailing delimiters make them. A comment right
    above the rows (as numpy.savetxt writes) serves as header when its cells fit one to one. Raises UnusableFileError
    when there is a header that does not name the columns.
    """
    cells = len(text.first)
    least = cells - _empty_at_the_end(text, cells)
    if text.header is not None:
        return _from_header(text, text.header, least, cells, file)
    before = [(at, line) for at, line in text.comments if at < text.lines[0]]
    if before:
        at, line = before[-1]
        first, *others = _readings(line.lstrip("#/%! \t"), text)
        # a line with the delimiter of the rows may also name columns without values
        readings = [first] if text.delimiter in line[1:].strip() and _fits(first, least, cells) else []
        fitting = (*readings, *(names for names in (first, *others) if len(names) == least))
        names = next((names for names in fitting if is_header(names)), None)
        if names is None and len(first) == least - 1 and is_header(first) and _has_row_names(text):
            names = ("", *first)
        if names is not None:
            message = f"taken for the header, since it names the columns: {line[:120]!r}"
            noticed = (*_comments(text, file, without=at), warn(file, Code.COMMENT, message, row=at))
            return Header(names, len(names), noticed)
    return Header(None, least, _comments(text, file))


def header_above(text: SplitText, *, file: str) -> tuple[tuple[str, ...], list[Finding]]:
    """The names of a table that must have a header, whatever its rows are: the reading that says most."""
    line, at = text.header, None
    before = [(at, line) for at, line in text.comments if at < text.lines[0]]
    if line is None and before:
        at, line = before[-1][0], before[-1][1].lstrip("#/%! \t")
    readings = list(_readings(line, text)) if line is not None else [()]
    names = max(readings, key=lambda names: sum(meaning_of(name) is not None for name in names))
    if all(len(row) == len(names) + 1 and row[-1].strip() for row in text.rows()) and _has_row_names(text):
        names = ("", *names)
    return names, list(_comments(text, file, without=at))


def _from_header(text: SplitText, header: str, least: int, cells: int, file: str) -> Header:
    readings = list(_readings(header, text))
    noticed = _comments(text, file)
    for names in readings:
        if _fits(names, least, cells) and not (text.delimiter != " " and any(text.delimiter in name for name in names)):
            shifted = _may_be_shifted(text, names)
            if shifted is not None and len(split_row(header, text.delimiter)) < cells:
                break
            if shifted is not None and text.delimiter == " ":  # where a cell without a value leaves no trace
                noticed = (*noticed, _counting(text, names, shifted, file, noticed))
            _require_no_thousands(text, names, file)
            return Header(names, len(names), noticed)
    of_rows = (names for names in readings[: 1 if text.delimiter != " " else None] if len(names) == least - 1)
    names = next(of_rows, ())
    if names and names[0].lower() not in _ROW_NAMES and _has_row_names(text):
        return Header(("", *names), least, noticed)
    shown = header.strip()[:120]
    message = f"the header {shown!r} does not name the {least} columns of the rows"
    if any(_fits(names, least, cells) for names in readings):
        message = (
            f"the header {shown!r} names fewer columns than the {cells} of the rows: either the first one holds row "
            "names, or the last one nothing; name all of them"
        )
    raise UnusableFileError([reject(file, Code.HEADER_MISMATCH, message, row=int(text.lines[0])), *noticed])


def _require_no_thousands(text: SplitText, names: Sequence[str], file: str) -> None:
    """A comma between thousands makes two cells of a number, and the last column takes the surplus if it has no values.

    Raises UnusableFileError where rows have more cells than the header, and a column that is used and the next one,
    which is not, may be one number.
    """
    if text.delimiter != "," or len(text.first) <= len(names):
        return
    for at in range(len(names) - 1):
        if meaning_of(names[at]) is None or meaning_of(names[at + 1]) is not None:
            continue
        if all(_THOUSANDS.fullmatch(",".join(row[at : at + 2])) for row in text.rows()):
            message = (
                f"{','.join(text.first[at : at + 2])!r} may be one number with a comma between thousands, since the "
                f"rows have more cells than the header; write it without, or no delimiter after the last column"
            )
            raise UnusableFileError(
                [reject(file, Code.HEADER_MISMATCH, message, row=int(text.lines[0]), column=names[at])]
            )


def _fits(names: Sequence[str], least: int, cells: int) -> bool:
    return least <= len(names) <= cells


def _readings(line: str, text: SplitText) -> Iterator[tuple[str, ...]]:
    """The cells of a header in each way of reading it, the way of the rows first."""
    ways: list[Callable[[str], Sequence[str]]] = [lambda each: split_row(each, text.delimiter)]
    ways += [lambda each, mark=mark: split_row(each, mark) for mark in (",", ";", "\t")]  # type: ignore[misc]
    # aligned columns, whose names may have single spaces
    ways += [lambda each: re.split(r" {2,}|\t", each.strip()), str.split]
    for way in ways:
        cells = [_name(cell) for cell in way(line)]
        while cells and not cells[-1]:
            cells.pop()
        yield tuple(cells)


def _name(cell: str) -> str:
    """A cell of a header without quotes around it; one that is too long for a name stays as it is, to be shown."""
    return unquoted(cell) or cell.strip().strip("\"'")


def _empty_at_the_end(text: SplitText, cells: int) -> int:
    """How many columns at the end have no value in any row."""
    ending, mark = 0, text.delimiter.encode()
    rows = text.body.count(b"\n")
    while ending + 1 < cells and mark != b" ":
        tail = mark * (ending + 1)
        if not (text.body.endswith(tail) and text.body.count(tail + b"\n") == rows):
            break
        ending += 1
    first = text.first
    if ending + 1 < cells and mark != b" " and not first[cells - 1 - ending].strip():
        # spaces or quotes without content; a last row that is cut off is told of by whoever reads the cells
        while ending + 1 < cells and all(
            len(row) < cells or not row[cells - 1 - ending].strip() for row in text.rows()
        ):
            ending += 1
    return ending


def _has_row_names(text: SplitText) -> bool:
    """Whether the first column counts the rows, or names them in quotes, as pandas and R write without a header."""
    if text.quote and all(row.startswith(text.quote.encode()) for row in text.body.split(b"\n")):
        names = [row[0] for row in text.rows()]
        return len(set(names)) == len(names)
    return _counts(row[0] for row in text.rows())


def _counts(cells: Iterable[str]) -> bool:
    """Whether they are whole numbers that increase."""
    before = -1
    for cell in cells:
        if not cell.strip().isdecimal() or int(cell) <= before:
            return False
        before = int(cell)
    return True


def _may_be_shifted(text: SplitText, names: Sequence[str]) -> str | None:
    """The name of a column that seems to count rows, where the first column does so: the names may be one off.

    A time may be whole numbers, unless what follows it may be the time. Few rows are no run.
    """
    if len(text.lines) < _FEW or not _counts(text.first[:1]) or not _counts(row[0] for row in text.rows()):
        return None
    for at, name in enumerate(names):
        meaning = meaning_of(name)
        if meaning is not None and _counts(text.first[at : at + 1]) and _counts(_column(text, at)):
            later = [cell.replace(",", ".") for cell in _column(text, at + 1)]
            in_order = all(map(is_number, later)) and all(number(a) < number(b) for a, b in itertools.pairwise(later))
            if meaning != "time_s" or in_order:
                return name
    return None


def _column(text: SplitText, at: int) -> Iterator[str]:
    return (row[at] if len(row) > at else "" for row in text.rows())


def _counting(text: SplitText, names: Sequence[str], name: str, file: str, noticed: Sequence[Finding]) -> Finding:
    """A word about a column that counts rows. Raises UnusableFileError where another one may have no values."""
    message = "counts the rows: {}; write 0.0 for a time, or a name above row names"
    if all(meaning_of(each) in REQUIRED for each in names):
        return warn(file, Code.HEADER_MISMATCH, message.format("times, or row names?"), column=name)
    message = message.format("the first one may hold row names, and another one no values")
    found = reject(file, Code.HEADER_MISMATCH, message, row=int(text.lines[0]), column=name)
    raise UnusableFileError([found, *noticed])


def _comments(text: SplitText, file: str, without: int | None = None) -> tuple[Finding, ...]:
    """What is to be said about the text: one finding for all lines that were taken for comments."""
    comments = [(at, line) for at, line in text.comments if at != without]
    if not comments:
        return text.noticed
    shown = ", ".join(f"line {at} {line[:40]!r}" for at, line in comments[:_SHOWN])
    more = f" and {len(comments) - _SHOWN} more" if len(comments) > _SHOWN else ""
    message = f"not read, since they begin as comments do: {shown}{more}"
    return (*text.noticed, warn(file, Code.COMMENT, message, row=comments[0][0]))
