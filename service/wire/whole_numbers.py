"""Whole numbers in an address are written in one way only: 8, not 08, +8 or 8.0."""

from __future__ import annotations

import re

from pydantic import BeforeValidator

_PLAIN = re.compile(r"0|-?[1-9][0-9]{0,17}")


def _written_plainly(value: object) -> object:
    if isinstance(value, str) and not _PLAIN.fullmatch(value):
        raise ValueError("a whole number in plain digits")
    return value


PLAIN_INTEGER = BeforeValidator(_written_plainly)
"""For a field that a query carries, after its bounds: `Annotated[int, Field(ge=1), PLAIN_INTEGER]`."""
