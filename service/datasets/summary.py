"""What a list of datasets shows of each: runs, rows, ranges, sampling, columns, sets, runs that vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from service.datasets.columns import INPUTS
from service.datasets.run import Dataset, Run

_LISTED = 1000  # a summary is a small document: runs that vary, named one by one


@dataclass(frozen=True, slots=True)
class Span:
    """Lowest and highest of a quantity over the runs."""

    lowest: float
    highest: float


@dataclass(frozen=True, slots=True)
class DatasetSummary:
    """Counts and ranges, in borders' units. `step_s` spans the median steps of the runs; `sets` counts runs.

    Slope and torque span all rows. `varies` counts the runs in which slope_deg, torque_nm and brake change, and
    `varying_runs` has, for the first thousand of them, from what to what (`brake_s`: how long the wheels are locked).
    """

    runs: int
    rows: int
    slope_deg: Span
    mass_kg: Span
    torque_nm: Span
    horizon_s: Span
    step_s: Span
    distance_m: Span
    columns: tuple[str, ...]
    sets: dict[str, int]
    varies: dict[str, int]
    varying_runs: dict[str, dict[str, Any]]

    def as_json(self) -> dict[str, object]:
        """Plain JSON content."""
        return asdict(self) | {"columns": list(self.columns)}


def summarise(dataset: Dataset) -> DatasetSummary:
    """The summary; `columns` are those that every run has."""
    runs = dataset.runs
    steps = [float(np.median(np.diff(run.time_s))) if len(run) > 1 else 0.0 for run in runs]
    shared = [name for name in runs[0].columns if all(name in run.columns for run in runs)]
    varying = [run for run in runs if run.varies]
    return DatasetSummary(
        runs=len(runs),
        rows=sum(len(run) for run in runs),
        slope_deg=_span_over_rows(runs, "slope_deg"),
        mass_kg=_span([run.mass_kg for run in runs]),
        torque_nm=_span_over_rows(runs, "torque_nm"),
        horizon_s=_span([run.horizon_s for run in runs]),
        # a median of differences of decimals: without the last binary digits of them
        step_s=_span([round(step, 9) for step in steps]),
        distance_m=_span([round(float(run.x_m[-1] - run.x_m[0]), 7) for run in runs]),
        columns=tuple(shared),
        sets={name: sum(run.set_name == name for run in runs) for name in dataset.sets},
        varies={name: sum(name in run.varies for run in runs) for name in INPUTS} if varying else {},
        varying_runs={run.name: _what_varies(run) for run in varying[:_LISTED]},
    )


def _what_varies(run: Run) -> dict[str, Any]:
    told: dict[str, Any] = {
        name: asdict(_span_over_rows([run], name)) for name in ("slope_deg", "torque_nm") if name in run.varies
    }
    if "brake" in run.varies:
        locked = run.columns["brake"][:-1] > 0
        told["brake_s"] = round(float(np.diff(run.time_s)[locked].sum()), 6)
    return told


def _span_over_rows(runs: Sequence[Run], name: str) -> Span:
    ends = [(run.columns[name].min(), run.columns[name].max()) if name in run.columns else (getattr(run, name),) * 2
            for run in runs]  # fmt: skip
    return Span(float(min(low for low, _ in ends)), float(max(high for _, high in ends)))


def _span(values: list[float]) -> Span:
    return Span(float(min(values)), float(max(values)))
