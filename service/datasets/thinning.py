"""Fewer rows of the same runs: every row that stays is one that the simulation wrote."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from service.datasets.checks.times import MIN_ROWS
from service.datasets.columns import BY_NAME
from service.datasets.run import Dataset, Run
from service.errors import InvalidValueError

PASSPORT_FIELD = "kept_rows"


def thinned(dataset: Dataset, step_s: float) -> Dataset:
    """The dataset with at most one row per `step_s` in each run: the first one in each interval of that length.

    The last row stays as well, and the first one with another torque or brake. Where rows are left out, the passport
    says so under `kept_rows`. Raises InvalidValueError for a step that leaves a run fewer rows than a run must have.
    """
    if not step_s > 0:
        raise InvalidValueError("step_s", step_s, "a time above 0 s")
    runs = tuple(_thinned(run, step_s) for run in dataset.runs)
    if all(len(run) == len(before) for run, before in zip(runs, dataset.runs, strict=True)):
        return dataset
    said = (
        f"of the simulation's rows at most one per {step_s:g} s: the first in each such interval, the last of the run"
    )
    said += ", and the first with another torque or brake; values are as simulated"
    return replace(dataset, passport=dataset.passport.model_copy(update={PASSPORT_FIELD: said}), runs=runs)


def _thinned(run: Run, step_s: float) -> Run:
    resolution = 1.0 / BY_NAME["time_s"].scale
    interval = np.floor((run.time_s - run.time_s[0] + resolution) / step_s)
    kept = np.diff(interval, prepend=-1.0) > 0
    kept[-1] = True
    for name in ("torque_nm", "brake"):
        if name in run.columns:
            kept[1:] |= np.diff(run.columns[name]) != 0
    if kept.sum() < min(MIN_ROWS, len(run)):
        allowed = f"a step that leaves each run {MIN_ROWS} rows; {run.name} would have {kept.sum()}"
        raise InvalidValueError("step_s", step_s, allowed)
    return run if kept.all() else run.rows(np.flatnonzero(kept))
