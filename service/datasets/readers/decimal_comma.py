"""Whether the numbers of a table have decimal commas, as programs write them in most of Europe: only beyond doubt.

"1,430" alone may be 1.43 or 1430. So a comma counts as decimal only where no number of the table has a point, no cell
has two commas, and at least one comma cannot separate thousands ("0,5", "12,25", "1430,125").
"""

from __future__ import annotations

import re
from collections.abc import Callable
from enum import StrEnum

from service.datasets.findings import Code, Finding, warn

_NO_THOUSANDS = (
    r"^[+-]?(?:0*,[0-9]+|[0-9]+,(?:[0-9]{1,2}|[0-9]{4,})|[0-9]{4,},[0-9]+|[0-9]+,[0-9]+[eEdDqQ][+-]?[0-9]+)$"
)
_LONGEST = 400
_WITH_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+(?:[eEdDqQ]?[+-]?[0-9]+)?")


class Commas(StrEnum):
    """What commas in numbers are; the value of one that is not read ends the message that refuses it."""

    NONE = ""
    DECIMAL = "decimal commas"
    DOUBTFUL = "; is the comma a decimal point, or does it separate thousands? Write decimals with a point"
    MIXED = "; other numbers of the table have points: write all decimals with a point, and thousands without a mark"


def commas_in(matches: Callable[[str], bool]) -> Commas:
    """What the commas in numbers are; `matches` says whether a pattern occurs in any of the trimmed cells."""
    if not matches(","):
        return Commas.NONE
    if matches(r"[0-9]\.|\.[0-9]"):
        return Commas.MIXED
    return Commas.DECIMAL if matches(_NO_THOUSANDS) and not matches(",.*,") else Commas.DOUBTFUL


def told(file: str, example: str) -> Finding:
    """A word about decimal commas."""
    message = f"decimals are written with a comma: {example!r} is read as {example.replace(',', '.')}"
    return warn(file, Code.DECIMAL_COMMA, message)


def is_with_comma(cell: str) -> bool:
    """Whether a cell looks like a number with one comma in it."""
    return len(cell) <= _LONGEST and _WITH_COMMA.fullmatch(cell.strip()) is not None
