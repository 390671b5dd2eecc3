"""What a list of datasets shows of each: runs, rows, ranges, sampling, columns, sets."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from service.datasets.run import Dataset


@dataclass(frozen=True, slots=True)
class Span:
    """Lowest and highest of a quantity over the runs."""

    lowest: float
    highest: float


@dataclass(frozen=True, slots=True)
class DatasetSummary:
    """Counts and ranges, in borders' units. `step_s` spans the median steps of the runs; `sets` counts runs."""

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

    def as_json(self) -> dict[str, object]:
        """Plain JSON content."""
        return asdict(self) | {"columns": list(self.columns)}


def summarise(dataset: Dataset) -> DatasetSummary:
    """The summary; `columns` are those that every run has."""
    runs = dataset.runs
    steps = [float(np.median(np.diff(run.time_s))) if len(run) > 1 else 0.0 for run in runs]
    shared = [name for name in runs[0].columns if all(name in run.columns for run in runs)]
    return DatasetSummary(
        runs=len(runs),
        rows=sum(len(run) for run in runs),
        slope_deg=_span([run.slope_deg for run in runs]),
        mass_kg=_span([run.mass_kg for run in runs]),
        torque_nm=_span([run.torque_nm for run in runs]),
        horizon_s=_span([run.horizon_s for run in runs]),
        # a median of differences of decimals: without the last binary digits of them
        step_s=_span([round(step, 9) for step in steps]),
        distance_m=_span([round(float(run.x_m[-1] - run.x_m[0]), 7) for run in runs]),
        columns=tuple(shared),
        sets={name: sum(run.set_name == name for run in runs) for name in dataset.sets},
    )


def _span(values: list[float]) -> Span:
    return Span(float(min(values)), float(max(values)))
