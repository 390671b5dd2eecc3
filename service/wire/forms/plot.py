"""A prediction as a picture: position against time in two panels, SVG or PNG.

Drawn through matplotlib's objects, without pyplot's global state. The same prediction gives the same bytes.
"""

from __future__ import annotations

import io
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from service.physics.scenario import Array
from service.wire.forms.numbers import require_finite
from service.wire.forms.subject import Subject

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_LINE_POINTS = 500
"""Points of a line that are drawn, spread evenly; the last one always. That bounds what a picture costs."""

_DPI = 110
_SIZE_INCHES = (7.5, 5.4)
_AXIS_LABELS = {
    "x_m": {"slope": "x, m\nalong the slope", "world": "x, m\nhorizontal"},
    "y_m": {"slope": "y, m\nnormal to the slope"},
    "z_m": {"world": "z, m\nup"},
}
# Okabe and Ito's colours, distinct to colour-blind readers; dashes differ as well, for print
_COLOUR, _PRIOR_COLOUR = "#009E73", "#0072B2"
# matplotlib reads process-wide parameters while it draws, and its fonts are not made for several threads
_drawing = threading.Lock()


def encode_svg(subject: Subject) -> bytes:
    """The picture as SVG, without date; letters are drawn as shapes, so that it looks the same everywhere.

    Raises NonFiniteError.
    """
    return _saved(subject, "svg", {"Date": None, "Creator": None})


def encode_png(subject: Subject) -> bytes:
    """The picture as PNG, 825 by 594 pixels. Raises NonFiniteError."""
    return _saved(subject, "png", {"Software": None})


def _saved(subject: Subject, kind: str, metadata: Mapping[str, str | None]) -> bytes:
    import matplotlib as mpl  # noqa: PLC0415 - a second that only those pay who ask for a picture

    require_finite(subject.columns(), "answer")
    buffer = io.BytesIO()
    # the salt makes the ids inside an SVG the same each time
    with _drawing, mpl.rc_context({"svg.hashsalt": "rover-twin", "svg.fonttype": "path"}):
        figure_of(subject).savefig(buffer, format=kind, dpi=_DPI, metadata=dict(metadata))
    return buffer.getvalue()


def figure_of(subject: Subject) -> Figure:
    """x above, y or z below, against time; with the band and the prior if the subject has them."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - as above

    columns = subject.columns()
    frame = subject.prediction.frame
    kept = _kept(len(columns["time_s"]))
    drawn = {name: values[kept] for name, values in columns.items()}
    figure = Figure(figsize=_SIZE_INCHES, facecolor="white")
    # fixed margins: to measure the texts for them would take longer than the rest
    figure.subplots_adjust(left=0.15, right=0.97, top=0.91, bottom=0.09, hspace=0.12)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, name in zip(panels, subject.prediction.position_names, strict=True):
        _panel(axes, drawn, name)
        axes.set_ylabel(_AXIS_LABELS[name][frame])
    panels[0].set_title(_title(subject), fontsize=10, loc="left")
    panels[-1].set_xlabel("time, s")
    if len(panels[0].get_legend_handles_labels()[0]) > 1:
        panels[0].legend(frameon=False, fontsize=9)
    return figure


def _panel(axes: Axes, columns: Mapping[str, Array], name: str) -> None:
    time, stem = columns["time_s"], name.removesuffix("_m")
    marker = "o" if len(time) == 1 else ""
    if f"{stem}_lower_m" in columns:
        lower, upper = columns[f"{stem}_lower_m"], columns[f"{stem}_upper_m"]
        axes.fill_between(time, lower, upper, color=_COLOUR, alpha=0.2, linewidth=0, label="band")
    if f"prior_{name}" in columns:
        prior = columns[f"prior_{name}"]
        axes.plot(time, prior, "--", color=_PRIOR_COLOUR, marker=marker, linewidth=1.4, label="prior alone")
    axes.plot(time, columns[name], "-", color=_COLOUR, marker=marker, linewidth=1.8, label="prediction")
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _title(subject: Subject) -> str:
    prediction, twin = subject.prediction, subject.loaded.twin
    scenario = prediction.scenario
    outside = "" if prediction.domain.inside else ", OUTSIDE the domain: extrapolated"
    band = "" if prediction.band is None else f", band {prediction.band.level:.3g}"
    return (
        f"{scenario.slope_deg:g}° slope, {scenario.mass_kg:g} kg, {scenario.torque_nm:g} N m: "
        f"{prediction.summary.outcome}{outside}\n{twin.name}@{twin.version}, {prediction.frame} frame{band}"
    )


def _kept(count: int) -> Array:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_LINE_POINTS)).round().astype(np.intp))
