"""Which rows of a long table without run names belong to one run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from service.datasets.checks.candidate import Array

Column = npt.NDArray[Any]
Rows = npt.NDArray[np.int64]
"""Indices of rows, increasing."""


def runs_in_table(
    time_s: Array, fixed: Sequence[Column], changing: Sequence[Column], *, may_change: bool = True
) -> list[Rows]:
    """The rows of each run, in order of their first rows; all columns are (row,).

    Two readings are tried. In the first one, the labels of a run never change: a run is all rows of equal labels,
    wherever they stand, and a new one begins where time starts again. In the second one, `changing` (slope, torque) may
    change underway: a run is what has equal `fixed` labels and lasts until time goes back. The first reading holds
    where all of its runs begin when runs do and go forward in time; else the second one, if that is so there, or if
    slope or torque are seen to change while time goes on, and never at one time. With `may_change` False runs may begin
    at any time, so only the first reading is left.
    """
    apart = [run for rows in _of_equal(len(time_s), [*fixed, *changing]) for run in _until_restart(time_s, rows)]
    if not changing or not may_change or _all_whole(time_s, apart):
        return _in_order(apart)
    together = [run for rows in _of_equal(len(time_s), fixed) for run in _until_back(time_s, rows)]
    change = _all_whole(time_s, together) or _change_underway(time_s, fixed, changing)
    return _in_order(together if change else apart)


def groups_of(key: npt.NDArray[np.int64]) -> list[Rows]:
    """Indices of the rows of each key, in order; the groups in order of their first row."""
    order = np.argsort(key, kind="stable")
    return _in_order(np.split(order, np.flatnonzero(np.diff(key[order])) + 1))


def _in_order(groups: list[Rows]) -> list[Rows]:
    return sorted(groups, key=lambda rows: int(rows[0]))


def _of_equal(count: int, columns: Sequence[Column]) -> list[Rows]:
    key = np.zeros(count, dtype=np.int64)
    for column in columns:
        values, codes = np.unique(column, return_inverse=True)
        key = np.unique(key * len(values) + codes, return_inverse=True)[1]
    return groups_of(key)


def _until_restart(time_s: Array, rows: Rows) -> list[Rows]:
    time = time_s[rows]
    return np.split(rows, np.flatnonzero((time[1:] < time[:-1]) & (time[1:] <= time[0])) + 1)


def _until_back(time_s: Array, rows: Rows) -> list[Rows]:
    return np.split(rows, np.flatnonzero(np.diff(time_s[rows]) < 0) + 1)


def _all_whole(time_s: Array, runs: Sequence[Rows]) -> bool:
    """Whether every run begins when the first of them does, or a step later, and goes forward in time."""
    begin = min(float(time_s[rows[0]]) for rows in runs)
    for rows in runs:
        steps = np.diff(time_s[rows])
        if len(steps) == 0 or not (steps > 0).all() or time_s[rows[0]] - begin > 1.5 * float(np.median(steps)):
            return False
    return True


def _change_underway(time_s: Array, fixed: Sequence[Column], changing: Sequence[Column]) -> bool:
    later = at_once = False
    for rows in _of_equal(len(time_s), fixed):
        steps = np.diff(time_s[rows])
        differs = np.any([column[rows][1:] != column[rows][:-1] for column in changing], axis=0)
        later |= bool((differs & (steps > 0)).any())
        at_once |= bool((differs & (steps == 0)).any())
    return later and not at_once
