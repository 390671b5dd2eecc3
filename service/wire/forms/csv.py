"""A prediction or a drive as a table: one header line, one line per time. What is no column goes into headers."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from service.wire.forms.numbers import dump
from service.wire.forms.subject import Writable


def encode_csv(subject: Writable) -> bytes:
    """Lines of comma-separated numbers, each ended by a line feed; true is 1, false 0. Raises NonFiniteError."""
    columns = subject.columns()
    # orjson writes a column many times faster than a loop would, and the digits are then those of the JSON answer
    numbers = [dump(_as_numbers(values))[1:-1].split(b",") for values in columns.values()]
    return b"\n".join([",".join(columns).encode(), *map(b",".join, zip(*numbers, strict=True)), b""])


def _as_numbers(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return values.astype(np.int64) if values.dtype == np.bool_ else values
