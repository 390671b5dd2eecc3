"""A table without a header and without a column map: what it may be. Only a suggestion, never a choice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from service.datasets.checks.labels import ABSURD, can_be_compared, mean_rates
from service.datasets.findings import Code, Finding, UnusableFileError, reject
from service.datasets.readers.presets import DEMOS, Demo
from service.datasets.readers.recognise import candidates, nothing_to_learn, places
from service.datasets.readers.table import Array, Table

_WINDOW_S = 0.05
_LOOSE_M_S, _LOOSE = 0.1, 0.2
"""How well a speed must fit: this much, m/s, and this part of it. Torques and forces are far from that."""


def with_suggestion(table: Table, faults: Sequence[Finding]) -> list[Finding]:
    """The faults of a table without a header, and a rejection that says what its columns may be, if that is known.

    It comes first where a preset reads such columns, else last.
    """
    presets, silent = candidates(table.width)
    columns = _numbers(table) if presets or silent else None
    if columns is None:
        return list(faults)
    likely = [key for key in presets if _fits(DEMOS[key], columns)]
    told = [f"if they are those of {DEMOS[key].program}, pass column_map={key}" for key in likely]
    told += [f"if they are {nothing_to_learn(each)}" for each in silent]
    if not told:
        return list(faults)
    message = f"{table.width} columns without a header: {'; or: '.join(told)}"
    named = reject(table.file, Code.MISSING_COLUMN, message, column="rear_x_m")
    return [named, *faults] if likely else [*faults, named]


def _numbers(table: Table) -> list[Array] | None:
    """All columns, if they are numbers and the first one may be a time."""
    try:
        columns = [column.values for column in table.numbers(range(table.width))]
    except UnusableFileError:
        return None
    return columns if can_be_compared(columns[0]) and columns[0][0] >= 0 else None


def _fits(demo: Demo, columns: list[Array]) -> bool:
    """Whether position and speed of this demo go together."""
    at = places(demo, None, len(columns))
    index = {name: at[source] for name, source in demo.sources.items()}
    if "speed_mps" not in index:
        return True
    time_s, x, speed = (columns[index[name]] for name in ("time_s", "rear_x_m", "speed_mps"))
    if not all(np.isfinite(each).all() and np.abs(each).max() < ABSURD for each in (x, speed)):
        return False
    means = mean_rates(time_s, x, speed, max(_WINDOW_S, 5.0 * float(np.median(np.diff(time_s)))))
    return means.error <= _LOOSE_M_S + _LOOSE * float(np.sqrt(np.mean(means.seen**2)))
