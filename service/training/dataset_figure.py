"""A dataset at a glance: where its rovers went, and which scenarios it covers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from service.datasets import Dataset, Run
from service.training.drawing import RENDERERS

MOST_RUNS = 400
"""Runs whose curves are drawn, spread evenly over the slopes."""

Rows = np.ndarray[tuple[int], np.dtype[np.int64]]

_MOST_POINTS = 200
_SHADES = 40  # of a curve whose slope changes
_COLOURS = "viridis"  # readable without colours too: its lightness rises steadily


def preview(dataset: Dataset, *, kind: str = "svg") -> bytes:
    """The figure as `svg` or `png`: distance against time of the runs, and torque against mass.

    Colours are slopes in both: those of each time where the slope changes, and in the scenarios that of the start. A
    line spans torques that change, a cross marks runs that brake. The same dataset gives the same bytes.
    Raises KeyError for another kind.
    """
    return RENDERERS[kind](preview_figure(dataset))


def preview_figure(dataset: Dataset) -> Figure:
    """The same as a figure, 10 by 4.2 inches."""
    runs = sorted(dataset.runs, key=lambda run: (run.slope_deg, run.name))
    acting = [run.columns["slope_deg"] if "slope_deg" in run.varies else np.array([run.slope_deg]) for run in runs]
    lowest, highest = min(float(slopes.min()) for slopes in acting), max(float(slopes.max()) for slopes in acting)
    colours = ScalarMappable(Normalize(lowest, max(highest, lowest + 1e-6)), _COLOURS)
    figure = Figure(figsize=(10, 4.2), layout="constrained", facecolor="white")
    distance, scenarios = figure.subplots(1, 2)
    _distance(distance, runs, colours)
    _scenarios(scenarios, runs, colours)
    figure.colorbar(colours, ax=scenarios, label="slope, deg")
    return figure


def _distance(axes: Axes, runs: list[Run], colours: ScalarMappable) -> None:
    drawn = [runs[index] for index in np.unique(np.linspace(0, len(runs) - 1, MOST_RUNS).round().astype(int))]
    pieces = [(run, rows, slope) for run in drawn for rows, slope in _pieces(run, colours)]
    lines = [np.column_stack([run.time_s[rows], run.x_m[rows]]) for run, rows, _ in pieces]
    curves = LineCollection(lines, linewidths=1.0, colors=colours.to_rgba(np.array([slope for *_, slope in pieces])))
    axes.add_collection(curves)
    axes.autoscale_view()
    some = f"{len(drawn)} of {len(runs)} runs" if len(drawn) < len(runs) else _count(runs)
    _dress(axes, f"Distance, {some}", "time, s", "distance along the slope, m")


def _scenarios(axes: Axes, runs: list[Run], colours: ScalarMappable) -> None:
    masses, torques = [run.mass_kg for run in runs], [run.torque_nm for run in runs]
    slopes = np.array([run.slope_deg for run in runs])
    axes.scatter(masses, torques, s=26, c=colours.to_rgba(slopes), edgecolors="#00000055")
    varying = [run for run in runs if run.varies]
    for run in varying:
        torque = run.acting("torque_nm")
        axes.plot([run.mass_kg] * 2, [torque.min(), torque.max()], color="#555555", linewidth=0.8, zorder=0)
    braking = [run for run in runs if "brake" in run.varies]
    if braking:
        places = [run.mass_kg for run in braking], [run.torque_nm for run in braking]
        axes.scatter(*places, s=60, c="#b00020", marker="x", linewidths=1.0)
    counted = f"{_count(runs)}, {len(varying)} that change underway" if varying else _count(runs)
    _dress(axes, f"Scenarios, {counted}", "mass, kg", "stall torque per wheel, N m")


def _dress(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


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
