"""A table without a header and without a column map: what it may be. Only a suggestion, never a choice."""

from __future__ import annotations

import numpy as np

from service.datasets.checks.labels import ABSURD, can_be_compared, mean_rates
from service.datasets.findings import Code, Finding, UnusableFileError, reject
from service.datasets.readers.presets import DEMOS, Demo
from service.datasets.readers.recognise import candidates, nothing_to_learn, places
from service.datasets.readers.table import Array, Table

_WINDOW_S = 0.05
_LOOSE_M_S, _LOOSE = 0.1, 0.2
"""How well a speed must fit: this much, m/s, and this part of it. Torques and forces are far from that."""


def suggestion(table: Table) -> Finding | None:
    """A rejection that names what the columns may be, and what to pass then; None where no program is known."""
    presets, silent = candidates(table.width)
    if not presets and not silent:
        return None
    try:
        columns = [column.values for column in table.numbers(range(table.width))]
    except UnusableFileError:
        return None
    if not can_be_compared(columns[0]) or columns[0][0] < 0:
        return None
    likely = [key for key in presets if _fits(DEMOS[key], columns)]
    told = [f"if they are those of {DEMOS[key].program}, pass column_map={key}" for key in likely]
    told += [nothing_to_learn(each) for each in silent]
    if not told:
        return None
    message = f"{table.width} columns without a header: {'; or: '.join(told)}"
    return reject(table.file, Code.MISSING_COLUMN, message, column="rear_x_m")


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
