"""What stands above the rows of a text: comments, titles, names of groups, the header itself, a row of units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from service.datasets.columns import MAX_COLUMNS, meaning_of, unquoted
from service.datasets.file_names import quoted
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.readers.numbers import NO_VALUE, is_number
from service.datasets.units import unit_named, unit_of

COMMENTS = ("#", "//", "%", "!")
NOTHING = " \t,;|\"'"
"""What rows without any value are made of."""

_SEPARATORS = re.compile(r"[,;|\s]+")
_WAYS = (re.compile(","), re.compile(";"), re.compile(r"\|"), re.compile(r"\t"), re.compile(r"\t| {2,}"),
         re.compile(r"\s+"))  # fmt: skip
_MOST_ABOVE = 20
_LONGEST_UNIT = 16
# a column map may choose a column whose name says nothing
_SI = {"ms": "s", "us": "s", "min": "s", "mm": "m", "cm": "m", "km": "m", "in": "m", "ft": "m"}


@dataclass(slots=True)
class Preamble:
    """`header` is None where the rows have none; they begin at byte `position`, below `count` lines."""

    header: str | None = None
    comments: list[tuple[int, str]] = field(default_factory=list)
    position: int = 0
    count: int = 0
    noticed: list[Finding] = field(default_factory=list)


def preamble_of(text: bytes, file: str) -> Preamble:
    """The lines up to the first row. Raises UnusableFileError where a row of units says another unit than the header.

    Of several lines of words the header is the first one that names two columns or more without doubt. A line of units
    may follow it. Lines above it and units are told in `noticed`.
    """
    found = Preamble()
    for line, end in _lines(text, 0):
        if line.lstrip().startswith(COMMENTS):
            found.comments.append((found.count + 1, line.strip()))
        elif line.strip(NOTHING):
            break
        found.position, found.count = end, found.count + 1
    else:
        return found
    if not _is_words(line):
        return found
    _take_header(text, found, file)
    _take_units(text, found, file)
    return found


def is_header(cells: Sequence[str]) -> bool:
    """Fewer than half of the cells are numbers. (One bad cell in the first row does not make it a header.)"""
    cells = [cell for cell in cells if cell.strip("\"'")]
    return sum(is_number(cell) for cell in cells) * 2 < len(cells)


def _is_words(line: str) -> bool:
    return is_header(_SEPARATORS.split(line, maxsplit=MAX_COLUMNS))


def _lines(text: bytes, position: int) -> Iterator[tuple[str, int]]:
    """Each line without spaces around it, and where the next one begins. Tabs stay: they make cells."""
    while position < len(text):
        end = text.find(b"\n", position)
        end = len(text) if end < 0 else end
        yield text[position:end].decode().strip(" "), end + 1
        position = end + 1


def _take_header(text: bytes, found: Preamble, file: str) -> None:
    """The line at `found.position`, or one of the next lines where that one names columns, and those above do not."""
    above: list[tuple[int, str]] = []
    start, count = found.position, found.count
    chosen = None
    for line, end in _lines(text, found.position):
        if _names_in(line) >= 2:
            chosen = (start, end, count + 1)
            break
        if len(above) >= _MOST_ABOVE or (line.strip(NOTHING) and not _is_words(line)):
            break
        if line.strip(NOTHING):
            above.append((count + 1, line))
        start, count = end, count + 1
    if chosen is None:
        start, count = found.position, found.count
        _, end = next(_lines(text, start))
        chosen, above = (start, end, count + 1), []
    units = _units_above(text, chosen, above, found, file) if above else None
    above = [each for each in above if each != units]
    if above:
        shown = ", ".join(f"line {at} {line[:60]!r}" for at, line in above[:3])
        message = f"not read, since the names of the columns stand below it: {shown}"
        found.noticed.append(warn(file, Code.COMMENT, message, row=above[0][0]))
    start, found.position, found.count = chosen
    found.header = text[start : found.position].decode().rstrip("\r\n ")


def _units_above(
    text: bytes, chosen: tuple[int, int, int], above: Sequence[tuple[int, str]], found: Preamble, file: str
) -> tuple[int, str] | None:
    """The line above the header that holds its units, if there is one; a word about it goes to `found`."""
    header = text[chosen[0] : chosen[1]].decode().rstrip("\r\n ")
    for at, line in above:
        for names, units in _as_cells(header, line):
            # names of groups may be like units: half of the cells must be known
            known = sum(unit_named(_bare(cell)) is not None for cell in units)
            if len(units) > 1 and _are_units(units) and 2 * known >= sum(map(bool, map(_bare, units))):
                found.noticed.append(_checked(names, units, line, at, file))
                return at, line
    return None


def _take_units(text: bytes, found: Preamble, file: str) -> None:
    """A line below the header that holds nothing but units."""
    count = found.count
    for line, end in _lines(text, found.position):
        count += 1
        if not line.strip(NOTHING):
            continue
        for names, units in _as_cells(found.header or "", line):
            if len(units) > 1 and _are_units(units):
                found.position, found.count = end, count
                found.noticed.append(_checked(names, units, line, count, file))
                return
        return


def _as_cells(header: str, line: str) -> Iterator[tuple[list[str], list[str]]]:
    """Header and line in cells, in each way that gives both as many."""
    for way in _WAYS:
        names, units = (
            [_without_quotes(cell) for cell in way.split(each.strip(" "), maxsplit=MAX_COLUMNS + 1)]
            for each in (header, line)
        )
        if len(units) == len(names) + 1 and not units[0]:
            names = ["", *names]  # R writes no name above row names
        if len(names) == len(units):
            yield names, units


def _without_quotes(cell: str) -> str:
    return unquoted(cell) or cell.strip(" \t\"'")


def _are_units(cells: Sequence[str]) -> bool:
    """Whether one of them is a known unit, and the others may be units too: short words, no numbers, no names."""
    filled = [cell for cell in map(_bare, cells) if cell]
    known = [cell for cell in filled if unit_named(cell) is not None and cell != "1"]
    others = [cell for cell in filled if unit_named(cell) is None]
    return bool(known) and all(
        len(cell) <= _LONGEST_UNIT and cell not in NO_VALUE and not is_number(cell) and meaning_of(cell) is None
        for cell in others
    )


def _bare(unit: str) -> str:
    return unit.strip("[](){}- ")


def _checked(names: Sequence[str], units: Sequence[str], line: str, at: int, file: str) -> Finding:
    """A word about the units. Raises UnusableFileError where one of them is not the one that is read."""
    wrong: list[tuple[str, str, str]] = []
    for name, cell in zip(names, units, strict=True):
        unit, meaning = unit_named(_bare(cell)), meaning_of(name)
        ours = unit_of(meaning) if meaning is not None else _SI.get(unit or "")
        if unit is None and meaning is not None and ours is not None and _bare(cell):
            wrong.append((name, f"{quoted(_bare(cell))}, a unit that is not known", ours))
        elif unit is not None and ours is not None and unit != ours:
            wrong.append((name, unit, ours))
    if wrong:
        listed = ", ".join(f"{quoted(name)} is in {unit}, expected {ours}" for name, unit, ours in wrong[:_MOST_ABOVE])
        message = f"{listed}, by the units in this line; convert it"
        raise UnusableFileError([reject(file, Code.UNITS, message, row=at, column=wrong[0][0])])
    return warn(file, Code.COMMENT, f"taken for the units of the columns: {line[:120]!r}", row=at)


def _names_in(line: str) -> int:
    """How many columns or labels a line names, in the way of reading it that finds most."""
    cells = (way.split(line, maxsplit=MAX_COLUMNS) for way in _WAYS)
    return max(len({meaning_of(cell) for cell in each} - {None}) for each in cells)
