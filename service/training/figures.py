"""The paper's four figures, for our runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from service.learning.observed import ObservedRun
from service.physics.scenario import Array, Positions
from service.training.drawing import SMALLEST_CM, log_cm, new_axes
from service.training.reproduce import OURS, PAPER_NETWORK, PRINTED_PRIOR, Reproduction, Trial

_SNAPSHOTS = 12  # figures 2 and 4 of the paper
_MOST_LINE_POINTS = 400
_PUBLISHED_CM = {PRINTED_PRIOR: 190.0, PAPER_NETWORK: 6.1}


@dataclass(frozen=True, slots=True)
class Style:
    """How one series looks. Colours are Okabe and Ito's, distinct to colour-blind readers; shapes and dashes differ
    as well, for print.
    """

    label: str
    colour: str
    marker: str
    dashes: str
    size: float = 6.0
    hollow: bool = False


_CHRONO = Style("Chrono", "#000000", "o", "-", size=12.0, hollow=True)
STYLES: dict[str, Style] = {
    PRINTED_PRIOR: Style("printed prior alone", "#0072B2", "v", ":"),
    PAPER_NETWORK: Style("paper's network", "#D55E00", "x", "--", size=7.0),
    OURS: Style("our model", "#009E73", "o", "-.", size=6.0),
}


def reproduction_figures(reproduction: Reproduction) -> dict[str, Figure]:
    """The paper's figures by plain file name, without ending."""
    drawn = {row.contestant.key: row.typical for row in reproduction.rows if row.contestant.key in STYLES}
    unseen, heavy = reproduction.course.unseen, reproduction.course.heavy
    at_unseen = {key: trial.unseen for key, trial in drawn.items()}
    return {
        "figure_2_positions": _positions(unseen, at_unseen, "Figure 2"),
        "figure_3_distance": _distance(unseen, at_unseen),
        "error_against_time": _error(unseen, drawn),
        "figure_4_double_mass": _positions(heavy, {key: trial.heavy for key, trial in drawn.items()}, "Figure 4"),
    }


def _scenario(run: ObservedRun) -> str:
    return f"{run.slope_deg:g}° slope, {run.mass_kg:g} kg, {run.torque_nm:g} N m"


def _positions(run: ObservedRun, predictions: Mapping[str, Positions], name: str) -> Figure:
    """Wheel centre in the slope frame at twelve times; heights in centimetres, since they differ by millimetres."""
    figure, axes = new_axes(
        f"{name}: rear wheel at {_SNAPSHOTS} times, {_scenario(run)}, unseen in training",
        "position along the slope, m",
        "height of the wheel centre\nabove the slope, cm",
    )
    chosen = np.linspace(0, len(run.time_s) - 1, _SNAPSHOTS).round().astype(int)
    _dots(axes, run.x_m[chosen], run.y_m[chosen], _CHRONO)
    for key, positions in predictions.items():
        _dots(axes, positions.x_m[0][chosen], positions.y_m[0][chosen], STYLES[key])
    for index in chosen[[0, _SNAPSHOTS // 2, -1]]:
        where = (float(run.x_m[index]), 100 * float(run.y_m[index]))
        axes.annotate(
            f"{run.time_s[index]:.2g} s",
            where,
            xytext=(0, -18),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            path_effects=[withStroke(linewidth=2, foreground="white")],
        )
    axes.margins(y=0.2)
    _legend(axes)
    return figure


def _dots(axes: Axes, x_m: Array, y_m: Array, style: Style) -> None:
    axes.plot(
        x_m,
        100 * y_m,
        linestyle="none",
        marker=style.marker,
        markersize=style.size,
        markerfacecolor="none" if style.hollow else style.colour,
        markeredgecolor=style.colour,
        markeredgewidth=1.5,
        label=style.label,
    )


def _distance(run: ObservedRun, predictions: Mapping[str, Positions]) -> Figure:
    figure, axes = new_axes(
        f"Figure 3: distance against time, {_scenario(run)}, unseen in training",
        "time, s",
        "distance along the slope, m",
    )
    _line(axes, run.time_s, run.x_m, _CHRONO, width=5.0, alpha=0.35)
    for key, positions in predictions.items():
        _line(axes, run.time_s, positions.x_m[0], STYLES[key])
    _legend(axes)
    return figure


def _error(run: ObservedRun, trials: Mapping[str, Trial]) -> Figure:
    figure, axes = new_axes(
        f"Error against time, {_scenario(run)}, unseen in training", "time, s", "distance from Chrono's position, cm"
    )
    log_cm(axes)
    for key, trial in trials.items():
        error_cm = 100 * np.hypot(trial.unseen.x_m[0] - run.x_m, trial.unseen.y_m[0] - run.y_m)
        _line(axes, run.time_s, np.maximum(error_cm, SMALLEST_CM), STYLES[key])
    for key, published_cm in _PUBLISHED_CM.items():
        axes.plot(
            run.horizon_s, published_cm, marker="*", markersize=13, linestyle="none", clip_on=False, zorder=5,
            markerfacecolor=STYLES[key].colour, markeredgecolor="white", label=f"{STYLES[key].label}, as published",
        )  # fmt: skip
    axes.set_xlim(0, run.horizon_s)
    _legend(axes)
    return figure


def _line(axes: Axes, time_s: Array, values: Array, style: Style, width: float = 1.8, alpha: float = 1.0) -> None:
    step = -(-len(time_s) // _MOST_LINE_POINTS)
    kept = np.unique(np.append(np.arange(0, len(time_s), step), len(time_s) - 1))
    axes.plot(
        time_s[kept],
        values[kept],
        style.dashes,
        color=style.colour,
        linewidth=width,
        alpha=alpha,
        label=style.label,
    )


def _legend(axes: Axes) -> None:
    """The legend beside the axes, where it hides nothing."""
    axes.legend(frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.02, 1.0))
