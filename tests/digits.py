"""How numbers look in text, said by Python's own rounding: what tests of every form compare with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

DECIMALS = 7
HALF = 0.5 * 10.0**-DECIMALS * 1.0001
"""What rounding moves a number at most, and what reading the decimal adds."""
TEXT_FORMS = ("json", "csv", "usda")
_AS_ASKED = ("time_s", "torque_nm")


def in_text(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Columns as they are read from any form that is text: to 1e-7 of their unit, but for what was asked for."""
    return {name: column if name in _AS_ASKED else rounded(column) for name, column in columns.items()}


def rounded(column: Any) -> np.ndarray:
    values = np.asarray(column)
    if values.dtype != np.float64:
        return values
    # no minus before a zero
    return np.array([round(each, DECIMALS) for each in values.ravel().tolist()]).reshape(values.shape) + 0.0
