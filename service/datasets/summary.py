"""What a list of datasets shows of each: runs, rows, ranges, sampling, columns, sets, runs that vary."""

from __future__ import annotations

from collections import Counter
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


@dataclass(frozen=True, slots=True)
class RunSummary:
    """What a summary needs of one run: small, whatever the run's length. Spans as in `DatasetSummary`."""

    name: str
    set_name: str
    rows: int
    slope_deg: Span
    mass_kg: float
    torque_nm: Span
    horizon_s: float
    step_s: float
    distance_m: float
    columns: tuple[str, ...]
    varies: tuple[str, ...]
    locked_s: float
    """How long the wheels are locked."""


def summarise_run(run: Run) -> RunSummary:
    """The summary of one run."""
    step_s = float(np.median(np.diff(run.time_s))) if len(run) > 1 else 0.0
    locked = run.columns["brake"][:-1] > 0 if "brake" in run.varies else np.zeros(len(run) - 1, dtype=bool)
    return RunSummary(
        name=run.name,
        set_name=run.set_name,
        rows=len(run),
        slope_deg=_over_rows(run, "slope_deg"),
        mass_kg=run.mass_kg,
        torque_nm=_over_rows(run, "torque_nm"),
        horizon_s=run.horizon_s,
        # a median of differences of decimals: without the last binary digits of them
        step_s=round(step_s, 9),
        distance_m=round(float(run.x_m[-1] - run.x_m[0]), 7),
        columns=tuple(run.columns),
        varies=run.varies,
        locked_s=round(float(np.diff(run.time_s)[locked].sum()), 6),
    )


def summarise(dataset: Dataset) -> DatasetSummary:
    """The summary of a dataset that is in memory."""
    return summary_of([summarise_run(run) for run in dataset.runs])


def summary_of(runs: Sequence[RunSummary]) -> DatasetSummary:
    """The summary of at least one run; `columns` are those that every run has."""
    varying = [run for run in runs if run.varies]
    return DatasetSummary(
        runs=len(runs),
        rows=sum(run.rows for run in runs),
        slope_deg=_all_of([run.slope_deg for run in runs]),
        mass_kg=_span([run.mass_kg for run in runs]),
        torque_nm=_all_of([run.torque_nm for run in runs]),
        horizon_s=_span([run.horizon_s for run in runs]),
        step_s=_span([run.step_s for run in runs]),
        distance_m=_span([run.distance_m for run in runs]),
        columns=tuple(name for name in runs[0].columns if all(name in run.columns for run in runs)),
        sets=dict(Counter(run.set_name for run in runs)),
        varies={name: sum(name in run.varies for run in runs) for name in INPUTS} if varying else {},
        varying_runs={run.name: _what_varies(run) for run in varying[:_LISTED]},
    )


def _what_varies(run: RunSummary) -> dict[str, Any]:
    told: dict[str, Any] = {
        name: asdict(getattr(run, name)) for name in ("slope_deg", "torque_nm") if name in run.varies
    }
    return told | ({"brake_s": run.locked_s} if "brake" in run.varies else {})


def _over_rows(run: Run, name: str) -> Span:
    if name not in run.columns:
        return Span(float(getattr(run, name)), float(getattr(run, name)))
    return Span(float(run.columns[name].min()), float(run.columns[name].max()))


def _all_of(spans: Sequence[Span]) -> Span:
    return Span(min(span.lowest for span in spans), max(span.highest for span in spans))


def _span(values: list[float]) -> Span:
    return Span(float(min(values)), float(max(values)))
