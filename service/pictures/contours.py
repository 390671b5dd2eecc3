"""Names on contours: each where it stands free of everything else that is drawn, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import QuadContourSet

Points = np.ndarray[Any, np.dtype[np.float64]]

_STEP_INCHES = 0.04  # between two points of a curve
_FONT_POINTS = 7.5
_HALF_LENGTH_INCHES = 0.3  # of a name, along its contour
_HALF_HEIGHT_INCHES = 0.05
_FREE_INCHES = 0.09  # from the middle of a name to the next thing
_ENOUGH_INCHES = 0.2  # more room makes no better place
_FROM_MIDDLE = 0.02  # how many inches of room an inch nearer to the middle of the contour is worth
_STRAIGHT = 0.985  # chord to arc below a name
_MINUS = "\N{MINUS SIGN}"
_NOWHERE = np.full((1, 2), 1e6)


def name_contours(axes: Axes, contours: QuadContourSet, unit: str) -> None:
    """Write the level and its unit on each contour once, where nothing else is near.

    Axes must have their limits, and the lines and texts that names keep off. A contour without such a place stays
    without a name.
    """
    curves = [[_dense(axes, each) for each in segments if len(each) > 1] for segments in contours.allsegs]
    others = [*_lines(axes), *_texts(axes)]
    places = []
    for number, segments in enumerate(curves):
        rest = [each for at, many in enumerate(curves) if at != number for each in many]
        best = None
        for at, curve in enumerate(segments):
            found = _place(axes, curve, np.concatenate([*others, *rest, *segments[:at], *segments[at + 1 :], _NOWHERE]))
            if found is not None and (best is None or found[0] > best[0]):
                best = found
        if best is not None:
            _, middle, spine = best
            places.append(axes.transData.inverted().transform(middle * _dpi(axes)))
            across = np.array([spine[0, 1] - spine[-1, 1], spine[-1, 0] - spine[0, 0]])
            across *= _HALF_HEIGHT_INCHES / max(float(np.hypot(*across)), 1e-9)
            others += [spine + across, spine - across]
    axes.clabel(
        contours,
        fontsize=_FONT_POINTS,
        fmt=lambda level: f"{level:g} {unit}".replace("-", _MINUS),  # a hyphen is lost among dashes
        inline_spacing=4,
        manual=places,
    )


def _place(axes: Axes, curve: Points, others: Points) -> tuple[float, Points, Points] | None:
    """The best place of a name on a curve: how good it is, its middle, the points of the curve below it; inches."""
    half = round(_HALF_LENGTH_INCHES / _STEP_INCHES)
    if len(curve) < 2 * half + 1:
        return None
    (left, low), (right, high) = axes.transAxes.transform([(0, 0), (1, 1)]) / _dpi(axes)
    room = np.min([np.min(np.hypot(*(curve[:, None] - others).transpose(2, 0, 1)), axis=1),
                   curve[:, 0] - left, right - curve[:, 0], curve[:, 1] - low, high - curve[:, 1]], axis=0)  # fmt: skip
    windows = np.lib.stride_tricks.sliding_window_view(room, 2 * half + 1)
    free = windows.min(axis=1)
    chord = np.hypot(*(curve[2 * half :] - curve[: -2 * half]).T)
    step = float(np.hypot(*np.diff(curve, axis=0).T).mean())
    away = np.abs(np.arange(len(free)) - (len(free) - 1) / 2) * step
    good = (free >= _FREE_INCHES) & (chord >= _STRAIGHT * 2 * half * step)
    if not good.any():
        return None
    worth = np.where(good, np.minimum(free, _ENOUGH_INCHES) - _FROM_MIDDLE * away, -np.inf)
    at = int(np.argmax(worth))
    return float(worth[at]), curve[at + half], curve[at : at + 2 * half + 1]


def _lines(axes: Axes) -> Iterator[Points]:
    for line in axes.lines:
        points = np.asarray(line.get_xydata(), float)
        points = points[np.isfinite(points).all(axis=1)]
        if len(points):
            yield _dense(axes, points)


def _texts(axes: Axes) -> Iterator[Points]:
    """A grid of points over each text, and over the room that its box takes around it."""
    for text in axes.texts:
        box = text.get_window_extent().padded(0.03 * _dpi(axes))
        (left, low), (right, high) = np.array(box.get_points()) / _dpi(axes)
        across, up = (np.linspace(a, b, 2 + int((b - a) / _STEP_INCHES)) for a, b in ((left, right), (low, high)))
        yield np.stack(np.meshgrid(across, up), axis=-1).reshape(-1, 2)


def _dense(axes: Axes, points: Points) -> Points:
    """The line through points of the axes' data, in inches, a point every so often."""
    inches = np.asarray(axes.transData.transform(points), float) / _dpi(axes)
    passed = np.append(0.0, np.cumsum(np.hypot(*np.diff(inches, axis=0).T)))
    places = np.linspace(0.0, passed[-1], 1 + max(1, round(passed[-1] / _STEP_INCHES)))
    return np.stack([np.interp(places, passed, inches[:, axis]) for axis in (0, 1)], axis=1)


def _dpi(axes: Axes) -> float:
    return float(axes.figure.dpi)
