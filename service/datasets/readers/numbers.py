"""Cells as numbers, in whatever way a program prints them."""

from __future__ import annotations

import re

# What C runtimes print for values that are not finite: nan, -nan(ind), 1.#QNAN, -1.#IND, 1.#INF
_NOT_FINITE = re.compile(r"[+-]?(nan(\([\w]*\))?|1\.#(qnan|snan|ind|inf)\w*)", re.IGNORECASE)
# Fortran: 1.0D-03, 1.0Q+00, and 1.0-103, since three digits leave no room for the letter
FORTRAN = (
    r"^(?:([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))[dDqQ]([+-]?[0-9]+)|([+-]?(?:[0-9]+\.[0-9]*|\.[0-9]+))([+-][0-9]{3}))$"
)
AS_C = r"\1\3e\2\4"
_FORTRAN = re.compile(FORTRAN)
_LONGEST = 100
AROUND = " \t\"'"
"""Characters around a number that do not belong to it."""

NO_VALUE = frozenset({"", "NA", "N/A", "#N/A", "<NA>", "NULL", "null", "None"})
"""How tools write a cell without a value."""


def number(cell: str) -> float:
    """A cell as float; raises ValueError. Python's own `1_000` is not a number here."""
    text = cell.strip(AROUND)
    if _NOT_FINITE.fullmatch(text):
        return float("nan")
    if "_" in text:
        raise ValueError(text)
    try:
        return float(text)
    except ValueError:
        if len(text) > _LONGEST:  # the pattern takes long for many digits
            raise
        return float(_FORTRAN.sub(AS_C, text))


def is_number(cell: str) -> bool:
    """Whether `number` reads it."""
    try:
        number(cell)
    except ValueError:
        return False
    return True
