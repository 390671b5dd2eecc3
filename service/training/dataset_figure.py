"""A dataset at a glance: where its rovers went, and which scenarios it covers."""

from __future__ import annotations

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

_MOST_POINTS = 200
_COLOURS = "viridis"  # readable without colours too: its lightness rises steadily


def preview(dataset: Dataset, *, kind: str = "svg") -> bytes:
    """The figure as `svg` or `png`: distance against time of the runs, and torque against mass.

    Colours are slopes in both. The same dataset gives the same bytes. Raises KeyError for another kind.
    """
    return RENDERERS[kind](preview_figure(dataset))


def preview_figure(dataset: Dataset) -> Figure:
    """The same as a figure, 10 by 4.2 inches."""
    runs = sorted(dataset.runs, key=lambda run: (run.slope_deg, run.name))
    slopes = [run.slope_deg for run in runs]
    colours = ScalarMappable(Normalize(slopes[0], max(slopes[-1], slopes[0] + 1e-6)), _COLOURS)
    figure = Figure(figsize=(10, 4.2), layout="constrained", facecolor="white")
    distance, scenarios = figure.subplots(1, 2)
    _distance(distance, runs, colours)
    _scenarios(scenarios, runs, colours)
    figure.colorbar(colours, ax=scenarios, label="slope, deg")
    return figure


def _distance(axes: Axes, runs: list[Run], colours: ScalarMappable) -> None:
    drawn = [runs[index] for index in np.unique(np.linspace(0, len(runs) - 1, MOST_RUNS).round().astype(int))]
    lines = [np.column_stack([run.time_s[rows], run.x_m[rows]]) for run in drawn for rows in [_rows(run)]]
    curves = LineCollection(lines, linewidths=1.0, colors=[colours.to_rgba(run.slope_deg) for run in drawn])
    axes.add_collection(curves)
    axes.autoscale_view()
    some = f"{len(drawn)} of {len(runs)} runs" if len(drawn) < len(runs) else _count(runs)
    _dress(axes, f"Distance, {some}", "time, s", "distance along the slope, m")


def _scenarios(axes: Axes, runs: list[Run], colours: ScalarMappable) -> None:
    masses, torques = [run.mass_kg for run in runs], [run.torque_nm for run in runs]
    slopes = np.array([run.slope_deg for run in runs])
    axes.scatter(masses, torques, s=26, c=colours.to_rgba(slopes), edgecolors="#00000055")
    _dress(axes, f"Scenarios, {_count(runs)}", "mass, kg", "stall torque per wheel, N m")


def _dress(axes: Axes, title: str, x_label: str, y_label: str) -> None:
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _rows(run: Run) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.unique(np.linspace(0, len(run) - 1, min(len(run), _MOST_POINTS)).round().astype(np.int64))


def _count(runs: list[Run]) -> str:
    return "1 run" if len(runs) == 1 else f"{len(runs)} runs"
