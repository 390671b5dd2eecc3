"""A prediction or a drive as a picture, SVG or PNG: its columns against time in panels, a drive's track from the side.

Drawn through matplotlib's objects, without pyplot's global state. The same answer gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from service.physics.scenario import Array
from service.pictures.drawing import Drawing, as_png, as_svg, dress
from service.pictures.palette import FIRST, HATCH, MARK, SECOND, SHADE
from service.wire.forms.numbers import require_finite
from service.wire.forms.side import draw_side
from service.wire.forms.subject import Picture, Writable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LINE_POINTS = 500
"""Points of a line that are drawn, spread evenly; the last one always. That bounds what a picture costs."""

_SIZE_INCHES = (7.5, 5.4)
_MORE_INCHES = 1.9  # for each panel beyond the second
_SIDE_INCHES = 2.6
_STRIP_INCHES = 1.45  # for each panel below a view from the side


def encode_svg(subject: Writable) -> bytes:
    """The picture as SVG, without date; letters are drawn as shapes, so that it looks the same everywhere.

    Raises NonFiniteError, and MissingPartError where Matplotlib is not installed.
    """
    return as_svg(drawing_of(subject))


def encode_png(subject: Writable) -> bytes:
    """The picture as PNG, 825 by 594 pixels for two panels, more for more. Raises as `encode_svg` does."""
    return as_png(drawing_of(subject))


def drawing_of(subject: Writable) -> Drawing:
    """The picture, to be drawn. Raises NonFiniteError."""
    require_finite(subject.columns(), "answer")
    picture = subject.picture()
    return Drawing(picture.title.replace("\n", ", "), picture.description, lambda: figure_of(subject))


def figure_of(subject: Writable) -> Figure:
    """Its panels, one below the other; with the band and the prior if the subject has them."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - a second that only those pay who ask for a picture

    columns, picture = subject.columns(), subject.picture()
    kept = _kept(len(columns["time_s"]))
    drawn = {name: values[kept] for name, values in columns.items()}
    width, count = _SIZE_INCHES[0], len(picture.panels)
    if picture.side is None:
        height = _SIZE_INCHES[1] + _MORE_INCHES * (count - 2)
        figure = Figure(figsize=(width, height))
        panels = figure.subplots(count, 1, sharex=True)
        # fixed margins: to measure the texts for them would take longer than the rest
        _margins(figure, height, top_inches=0.49, below_inches=0.49)
        panels[0].set_title(picture.title, fontsize=10, loc="left")
    else:
        height = _SIDE_INCHES + _STRIP_INCHES * count + 1.55
        figure = Figure(figsize=(width, height))
        view, panels = _rows(figure, count, height)
        draw_side(view, picture.side, (0.82 * width, _SIDE_INCHES))
        view.set_title(picture.title, fontsize=10, loc="left")
    for axes, (name, label) in zip(panels, picture.panels, strict=True):
        _panel(axes, drawn, name, held=name in picture.held)
        if picture.shaded and drawn[picture.shaded].any():
            _shade(axes, drawn["time_s"], drawn[picture.shaded], picture.shaded)
        for number, (begin, end) in enumerate(picture.hatched):
            told = "outside the domain" if number == 0 else None
            axes.axvspan(
                begin, end, facecolor="none", edgecolor=HATCH, hatch="///", lw=0, alpha=0.4, zorder=0, label=told
            )
        axes.set_ylabel(label)
        axes.yaxis.set_label_coords(-0.085, 0.5)
        for time, _ in picture.marks:
            axes.axvline(time, color=MARK, linewidth=0.9, linestyle=":")
    _name_marks(panels[0], picture)
    panels[-1].set_xlabel("time, s")
    if len(panels[0].get_legend_handles_labels()[0]) > 1:
        panels[0].legend(frameon=False, fontsize=8 if picture.side else 9)
    return figure


def _margins(figure: Figure, height: float, *, top_inches: float, below_inches: float) -> None:
    top, bottom = 1.0 - top_inches / height, below_inches / height
    figure.subplots_adjust(left=0.15, right=0.97, top=top, bottom=bottom, hspace=0.12)


def _rows(figure: Figure, count: int, height: float) -> tuple[Axes, list[Axes]]:
    """The axes of the view from the side, and below it those of the panels, which share their time."""
    top = 0.55 / height
    view = figure.add_axes((0.15, 1.0 - top - _SIDE_INCHES / height, 0.82, _SIDE_INCHES / height))
    first = 1.0 - top - (_SIDE_INCHES + 0.55) / height
    each = _STRIP_INCHES / height
    panels: list[Axes] = []
    for row in range(count):
        box = (0.15, first - (row + 1) * each + 0.012, 0.82, each - 0.012)
        panels.append(figure.add_axes(box, sharex=panels[0] if panels else None))
        panels[-1].tick_params(labelbottom=row == count - 1)
    return view, panels


def _name_marks(axes: Axes, picture: Picture) -> None:
    for time, name in picture.marks:
        axes.annotate(
            name,
            (time, 0.02),
            xycoords=("data", "axes fraction"),
            xytext=(2, 0),
            textcoords="offset points",
            rotation=90,
            fontsize=8,
            color=MARK,
        )


def _shade(axes: Axes, time: Array, holds: Array, name: str) -> None:
    """Each time where it holds until the next one."""
    there = holds.astype(np.bool_)
    there[1:] |= there[:-1]
    whole_height = axes.get_xaxis_transform()
    axes.fill_between(
        time,
        0,
        1,
        where=there,
        step="post",
        transform=whole_height,
        color=SHADE,
        linewidth=0,
        zorder=0,
        label=name,
    )


def _panel(axes: Axes, columns: Mapping[str, Array], name: str, *, held: bool = False) -> None:
    time, stem = columns["time_s"], name.removesuffix("_m")
    marker = "o" if len(time) == 1 else ""
    if f"{stem}_lower_m" in columns:
        lower, upper = columns[f"{stem}_lower_m"], columns[f"{stem}_upper_m"]
        axes.fill_between(time, lower, upper, color=FIRST, alpha=0.2, linewidth=0, label="band")
    if f"prior_{name}" in columns:
        prior = columns[f"prior_{name}"]
        axes.plot(time, prior, "--", color=SECOND, marker=marker, linewidth=1.4, label="prior alone")
    way = "steps-post" if held else "default"
    axes.plot(time, columns[name], "-", drawstyle=way, color=FIRST, marker=marker, linewidth=1.8, label="prediction")
    if held:
        axes.set_ylim(bottom=min(0.0, float(columns[name].min())) - 0.04 * (float(np.ptp(columns[name])) or 1.0))
    dress(axes)


def _kept(count: int) -> Array:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_LINE_POINTS)).round().astype(np.intp))
