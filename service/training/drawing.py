"""The look that figures share, and figures as bytes. A preview draws with it, and so it imports no learning.

Drawn through matplotlib's objects, without pyplot's global state. The same input gives the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Callable

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

SMALLEST_CM = 0.01  # a tenth of a millimetre: where the logarithmic error axis begins


def as_svg(figure: Figure) -> bytes:
    """The figure as SVG, without date."""
    return _saved(figure, "svg", {"Date": None, "Creator": None})


def as_png(figure: Figure) -> bytes:
    """The figure as PNG, for viewers that show no SVG."""
    return _saved(figure, "png", {"Software": None})


def _saved(figure: Figure, kind: str, metadata: dict[str, str | None]) -> bytes:
    buffer = io.BytesIO()
    # `svg.hashsalt` makes the ids inside an SVG the same each time; `path` draws letters the same everywhere
    with mpl.rc_context({"svg.hashsalt": "rover-twin", "svg.fonttype": "path"}):
        figure.savefig(buffer, format=kind, dpi=110, metadata=metadata)
    return buffer.getvalue()


def new_axes(title: str, x_label: str, y_label: str, size: tuple[float, float] = (7.5, 4.2)) -> tuple[Figure, Axes]:
    """An empty figure with the look that all share; size in inches."""
    figure = Figure(figsize=size, layout="constrained", facecolor="white")
    axes = figure.add_subplot()
    axes.set_title(title, fontsize=11, loc="left")
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def log_cm(axes: Axes) -> None:
    """A logarithmic error axis with plain numbers."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")


RENDERERS: dict[str, Callable[[Figure], bytes]] = {"svg": as_svg, "png": as_png}
