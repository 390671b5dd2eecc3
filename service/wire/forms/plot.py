"""A prediction or a drive as a picture: its columns against time in panels, SVG or PNG.

Drawn through matplotlib's objects, without pyplot's global state. The same answer gives the same bytes.
"""

from __future__ import annotations

import io
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from service import parts
from service.physics.scenario import Array
from service.wire.forms.numbers import require_finite
from service.wire.forms.subject import Picture, Writable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LINE_POINTS = 500
"""Points of a line that are drawn, spread evenly; the last one always. That bounds what a picture costs."""

_DPI = 110
_SIZE_INCHES = (7.5, 5.4)
_MORE_INCHES = 1.9  # for each panel beyond the second
# Okabe and Ito's colours, distinct to colour-blind readers; dashes differ as well, for print
_COLOUR, _PRIOR_COLOUR, _MARK_COLOUR = "#009E73", "#0072B2", "#D55E00"
_SHADE_COLOUR = "#eeeeee"
# matplotlib reads process-wide parameters while it draws, and its fonts are not made for several threads
_drawing = threading.Lock()


def encode_svg(subject: Writable) -> bytes:
    """The picture as SVG, without date; letters are drawn as shapes, so that it looks the same everywhere.

    Raises NonFiniteError, and MissingPartError where Matplotlib is not installed.
    """
    return _saved(subject, "svg", {"Date": None, "Creator": None})


def encode_png(subject: Writable) -> bytes:
    """The picture as PNG, 825 by 594 pixels for two panels, more for more. Raises as `encode_svg` does."""
    return _saved(subject, "png", {"Software": None})


def _saved(subject: Writable, kind: str, metadata: Mapping[str, str | None]) -> bytes:
    parts.require(parts.PICTURES, f"format={kind}")
    import matplotlib as mpl  # noqa: PLC0415 - a second that only those pay who ask for a picture

    require_finite(subject.columns(), "answer")
    buffer = io.BytesIO()
    # the salt makes the ids inside an SVG the same each time
    with _drawing, mpl.rc_context({"svg.hashsalt": "rover-twin", "svg.fonttype": "path"}):
        figure_of(subject).savefig(buffer, format=kind, dpi=_DPI, metadata=dict(metadata))
    return buffer.getvalue()


def figure_of(subject: Writable) -> Figure:
    """Its panels, one below the other; with the band and the prior if the subject has them."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - as above

    columns, picture = subject.columns(), subject.picture()
    kept = _kept(len(columns["time_s"]))
    drawn = {name: values[kept] for name, values in columns.items()}
    height = _SIZE_INCHES[1] + _MORE_INCHES * (len(picture.panels) - 2)
    figure = Figure(figsize=(_SIZE_INCHES[0], height), facecolor="white")
    # fixed margins: to measure the texts for them would take longer than the rest
    inch = _SIZE_INCHES[1] / height
    figure.subplots_adjust(left=0.15, right=0.97, top=1.0 - 0.09 * inch, bottom=0.09 * inch, hspace=0.12)
    panels = figure.subplots(len(picture.panels), 1, sharex=True)
    for axes, (name, label) in zip(panels, picture.panels, strict=True):
        _panel(axes, drawn, name, held=name in picture.held)
        if picture.shaded and drawn[picture.shaded].any():
            _shade(axes, drawn["time_s"], drawn[picture.shaded], picture.shaded)
        axes.set_ylabel(label)
        for time, _ in picture.marks:
            axes.axvline(time, color=_MARK_COLOUR, linewidth=0.9, linestyle=":")
    _name_marks(panels[0], picture)
    panels[0].set_title(picture.title, fontsize=10, loc="left")
    panels[-1].set_xlabel("time, s")
    if len(panels[0].get_legend_handles_labels()[0]) > 1:
        panels[0].legend(frameon=False, fontsize=9)
    return figure


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
            color=_MARK_COLOUR,
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
        color=_SHADE_COLOUR,
        linewidth=0,
        zorder=0,
        label=name,
    )


def _panel(axes: Axes, columns: Mapping[str, Array], name: str, *, held: bool = False) -> None:
    time, stem = columns["time_s"], name.removesuffix("_m")
    marker = "o" if len(time) == 1 else ""
    if f"{stem}_lower_m" in columns:
        lower, upper = columns[f"{stem}_lower_m"], columns[f"{stem}_upper_m"]
        axes.fill_between(time, lower, upper, color=_COLOUR, alpha=0.2, linewidth=0, label="band")
    if f"prior_{name}" in columns:
        prior = columns[f"prior_{name}"]
        axes.plot(time, prior, "--", color=_PRIOR_COLOUR, marker=marker, linewidth=1.4, label="prior alone")
    way = "steps-post" if held else "default"
    axes.plot(time, columns[name], "-", drawstyle=way, color=_COLOUR, marker=marker, linewidth=1.8, label="prediction")
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _kept(count: int) -> Array:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_LINE_POINTS)).round().astype(np.intp))
