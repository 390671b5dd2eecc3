"""A dataset at a glance: where its rovers went, and which scenarios it covers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure

from model_store import DatasetRecord
from service.datasets import Dataset, Run
from service.pictures.drawing import Drawing, as_png, as_svg, dress
from service.pictures.palette import FAINT, MARK
from service.pictures.report import Report, Section, Table, as_html

MOST_RUNS = 400
"""Runs whose curves are drawn, spread evenly over the slopes."""

MOST_ROWS = 1_000
"""Runs that the table of a page lists."""

Rows = np.ndarray[tuple[int], np.dtype[np.int64]]

_MOST_POINTS = 200
_SHADES = 40  # of a curve whose slope changes


@dataclass(frozen=True, slots=True)
class Origin:
    """What the store knows of a dataset beside its runs. Its name and description come from strangers."""

    name: str
    identity: str
    description: str
    stored: str

    @classmethod
    def of(cls, record: DatasetRecord) -> Self:
        """That of a stored dataset."""
        stored = f"{record.created_at:%Y-%m-%d %H:%M} UTC by {record.created_by}"
        return cls(record.name, record.id, record.description, stored)


def preview(dataset: Dataset, *, kind: str = "svg", origin: Origin | None = None) -> bytes:
    """The figure as `svg` or `png`: distance against time of the runs, and torque against mass; or as a page, `html`.

    Colours are slopes in both: those of each time where the slope changes, and in the scenarios that of the start. A
    line spans torques that change, a cross marks runs that brake. The same dataset gives the same bytes.
    Raises KeyError for another kind.
    """
    drawing = Drawing(f"Dataset {dataset.name}", _told(dataset), lambda: preview_figure(dataset))
    if kind == "html":
        return _page(dataset, drawing, origin)
    return {"svg": as_svg, "png": as_png}[kind](drawing)


def preview_figure(dataset: Dataset) -> Figure:
    """The same as a figure, 10 by 4.2 inches."""
    runs = sorted(dataset.runs, key=lambda run: (run.slope_deg, run.name))
    acting = [run.columns["slope_deg"] if "slope_deg" in run.varies else np.array([run.slope_deg]) for run in runs]
    lowest, highest = min(float(slopes.min()) for slopes in acting), max(float(slopes.max()) for slopes in acting)
    colours = ScalarMappable(Normalize(lowest, max(highest, lowest + 1e-6)), _colours())
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    distance, scenarios = figure.subplots(1, 2)
    _distance(distance, runs, colours)
    _scenarios(scenarios, runs, colours)
    figure.colorbar(colours, ax=scenarios, label="slope, deg")
    return figure


def _colours() -> ListedColormap:
    """Viridis without its ends: its lightness rises steadily, and it can be seen on white and on a dark page."""
    return ListedColormap(colormaps["viridis"](np.linspace(0.24, 0.9, 256)))


def _told(dataset: Dataset) -> str:
    runs = dataset.runs
    slopes, varying = [run.slope_deg for run in runs], sum(bool(run.varies) for run in runs)
    return (
        f"{_count(list(runs))}, coloured by slope from {min(slopes):.4g} to {max(slopes):.4g} degrees. Left the "
        f"distance along the slope against time, right torque against mass. In {varying} runs slope, torque or brake "
        "change underway."
    )


def _page(dataset: Dataset, drawing: Drawing, origin: Origin | None) -> bytes:
    """The figure with the runs in a table. Their names come from strangers."""
    runs = sorted(dataset.runs, key=lambda run: (run.slope_deg, run.name))
    ends = [float(run.x_m[-1] - run.x_m[0]) for run in runs]
    kept = {} if origin is None else {"stored": origin.stored, "id": origin.identity}
    columns = ("run", "set", "slope_deg", "mass_kg", "torque_nm", "horizon_s", "end, m", "rows", "changes")
    rows = [
        (run.name, run.set_name, run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s, end, len(run),
         ", ".join(sorted(run.varies)))
        for run, end in zip(runs, ends, strict=True)
    ]  # fmt: skip
    shown = rows[:MOST_ROWS]
    caption = (
        f"All {_count(runs)}" if len(shown) == len(rows) else f"The first {len(shown)} of {_count(runs)}, by slope"
    )
    return as_html(
        Report(
            title=f"Dataset {dataset.name if origin is None else origin.name}",
            lead=origin.description if origin is not None else "",
            facts={"runs": len(runs), "rows": sum(map(len, runs)), **kept},
            sections=[
                Section("Its runs", [drawing.description], figure=drawing, tables=[Table(caption, columns, shown)]),
            ],
        )
    )


def _distance(axes: Axes, runs: list[Run], colours: ScalarMappable) -> None:
    drawn = [runs[index] for index in np.unique(np.linspace(0, len(runs) - 1, MOST_RUNS).round().astype(int))]
    pieces = [(run, rows, slope) for run in drawn for rows, slope in _pieces(run, colours)]
    lines = [np.column_stack([run.time_s[rows], run.x_m[rows]]) for run, rows, _ in pieces]
    curves = LineCollection(lines, linewidths=1.0, colors=colours.to_rgba(np.array([slope for *_, slope in pieces])))
    axes.add_collection(curves)
    axes.autoscale_view()
    some = f"{len(drawn)} of {len(runs)} runs" if len(drawn) < len(runs) else _count(runs)
    dress(axes, f"Distance, {some}", "time, s", "distance along the slope, m")


def _scenarios(axes: Axes, runs: list[Run], colours: ScalarMappable) -> None:
    masses, torques = [run.mass_kg for run in runs], [run.torque_nm for run in runs]
    slopes = np.array([run.slope_deg for run in runs])
    axes.scatter(masses, torques, s=26, c=colours.to_rgba(slopes), edgecolors=FAINT, linewidths=0.4)
    varying = [run for run in runs if run.varies]
    for run in varying:
        torque = run.acting("torque_nm")
        axes.plot([run.mass_kg] * 2, [torque.min(), torque.max()], color=FAINT, linewidth=0.8, zorder=0)
    braking = [run for run in runs if "brake" in run.varies]
    if braking:
        places = [run.mass_kg for run in braking], [run.torque_nm for run in braking]
        axes.scatter(*places, s=60, c=MARK, marker="x", linewidths=1.0)
    counted = f"{_count(runs)}, {len(varying)} that change underway" if varying else _count(runs)
    dress(axes, f"Scenarios, {counted}", "mass, kg", "stall torque per wheel, N m")


def _pieces(run: Run, colours: ScalarMappable) -> Iterator[tuple[Rows, float]]:
    """Rows of the curve's pieces, each of one colour, with its slope; neighbours share a row."""
    rows = _rows(run)
    if "slope_deg" not in run.varies:
        yield rows, run.slope_deg
        return
    slopes = run.columns["slope_deg"][rows]
    shade = np.rint(np.asarray(colours.norm(slopes)) * _SHADES)
    starts = [0, *(np.flatnonzero(np.diff(shade)) + 1).tolist()]
    for start, end in zip(starts, [*starts[1:], len(rows) - 1], strict=True):
        if end > start or len(starts) == 1:
            yield rows[start : end + 1], float(slopes[start])


def _rows(run: Run) -> Rows:
    return np.unique(np.linspace(0, len(run) - 1, min(len(run), _MOST_POINTS)).round().astype(np.int64))


def _count(runs: list[Run]) -> str:
    return "1 run" if len(runs) == 1 else f"{len(runs)} runs"
