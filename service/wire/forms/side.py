"""A track from the side: ground, way, what happened where, and the rover at its end."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from service.physics.scenario import Array
from service.pictures.drawing import dress
from service.pictures.palette import FAINT, FIRST, INK, MARK, SHADE
from service.wire.forms.subject import Side

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FILLED = 0.55  # of the height, by a track whose heights are drawn larger than they are
_FLAT = 0.22  # of the height: a track that fills less is drawn higher than it is
_MOST_TIMES = 50
_SMALLEST_ROVER = 0.02  # of the width
_MARGIN = 0.06
_EARTH = 0.22  # of the height, below the lowest place


def draw_side(axes: Axes, side: Side, inches: tuple[float, float]) -> None:
    """Draw it into axes of this width and height. Flat tracks get larger heights, and the axis says how much."""
    times = _limits(axes, side, inches[1] / inches[0])
    floor = axes.get_ylim()[0]
    across, up = side.ground_m
    axes.fill_between(across, up, floor, color=SHADE, linewidth=0, zorder=1)
    axes.plot(across, up, color=FAINT, linewidth=1.4, zorder=2, label="ground")
    axes.plot(*side.way_m, color=FIRST, linewidth=1.8, zorder=4, label="rear wheel's centre")
    axes.plot(side.way_m[0][0], side.way_m[1][0], "o", color=FIRST, markersize=4, zorder=4)
    if times == 1:
        _rover(axes, side)
    for number, (x, z, name) in enumerate(side.marks):
        axes.plot(x, z, "o", color=MARK, markersize=4.5, zorder=6)
        axes.annotate(
            name, (x, z), xytext=(0, -26 - 11 * (number % 3)), textcoords="offset points", ha="center", fontsize=8,
            color=MARK, zorder=6, arrowprops={"arrowstyle": "-", "color": MARK, "linewidth": 0.7, "shrinkB": 3},
        )  # fmt: skip
    scaled = "" if times == 1 else f"\nheights {times} times"
    dress(axes, "", "horizontal, m", f"up, m{scaled}")


def _limits(axes: Axes, side: Side, shape: float) -> int:
    """Limits that hold everything; the result is how many times heights are drawn larger than widths."""
    across = np.concatenate([side.ground_m[0], side.way_m[0]])
    up = np.concatenate([side.ground_m[1], side.way_m[1]])
    radius = side.rover[2]
    width, height = float(np.ptp(across)) * (1 + 2 * _MARGIN), float(np.ptp(up)) + 4.0 * radius
    times = 1
    if height < _FLAT * width * shape:
        times = max(1, min(_MOST_TIMES, math.floor(_FILLED * width * shape / height)))
    if times == 1:  # the rover is drawn, from its wheels to the top of its mast
        outline = np.concatenate(_outline(side))
        across, up = np.append(across, outline[:, 0]), np.append(up, outline[:, 1])
        width, height = float(np.ptp(across)) * (1 + 2 * _MARGIN), float(np.ptp(up)) + 2.0 * radius
    shown = max(width * shape / times, height)
    width = max(width, shown * times / shape)
    middle = float(across.min() + across.max()) / 2
    below = min(_EARTH * shown, shown - height)
    low = float(up.min()) - max(below, 0.0) - 0.5 * radius
    axes.set_xlim(middle - width / 2, middle + width / 2)
    axes.set_ylim(low, low + shown)
    return times


def _outline(side: Side) -> tuple[Array, Array]:
    """The body's corners and the mast's ends, (point, 2), metres."""
    rear, front = (np.array(each) for each in side.rover[:2])
    length = float(np.hypot(*(front - rear)))
    ahead = (front - rear) / length
    upward = np.array([-ahead[1], ahead[0]])
    corners = ((-0.15, 0.2), (length + 0.15, 0.2), (length + 0.15, 0.85), (-0.15, 0.85))
    mast = ((length - 0.1, 0.85), (length - 0.1, 1.35))
    body, pole = (np.array([rear + x * ahead + z * upward for x, z in points]) for points in (corners, mast))
    return body, pole


def _rover(axes: Axes, side: Side) -> None:
    """Two wheels, a body and a mast, where the drive ends; left out where it would be a speck."""
    from matplotlib.patches import Circle, Polygon  # noqa: PLC0415 - as in `plot`

    rear, front, radius = (np.array(each) for each in side.rover)
    low, high = axes.get_xlim()
    if float(np.hypot(*(front - rear))) < _SMALLEST_ROVER * (high - low):
        return
    body, mast = _outline(side)
    axes.add_patch(Polygon(body, closed=True, facecolor=SHADE, edgecolor=INK, linewidth=1.0, zorder=3))
    axes.plot(mast[:, 0], mast[:, 1], color=INK, linewidth=1.4, zorder=3)
    for centre in (rear, front):
        wheel = Circle((float(centre[0]), float(centre[1])), float(radius), facecolor=FAINT, edgecolor=INK, zorder=3)
        axes.add_patch(wheel)
