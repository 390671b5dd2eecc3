"""A mobility map for people: where the rover climbs, stalls and slides, how fast, how steep it surely goes.

Slopes go to the right, torques up. Fields of one outcome are one colour, and their names stand on them. Hatched is what
lies outside the model's domain.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from service.physics.scenario import Array
from service.pictures.contours import name_contours
from service.pictures.drawing import Drawing, dress
from service.pictures.palette import CLIMBS, HATCH, INK, PAPER, SECOND, SLIDES, STALLS
from service.pictures.report import Cell, Report, Section, Table, as_html
from service.twin import Loaded, Outcome
from service.twin.mobility import MobilityMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {Outcome.CLIMBS: CLIMBS, Outcome.STALLS: STALLS, Outcome.SLIDES: SLIDES}
_SPEEDS_M_S = (-0.5, -0.2, -0.1, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
_SIZE_INCHES = (8.2, 5.6)
_MANY = 20  # torques: smaller dots
_SMALLEST_FIELD = 0.015  # of the map: smaller ones go without their name


def drawing_of_map(loaded: Loaded, found: MobilityMap) -> Drawing:
    """The map, to be drawn."""
    return Drawing(_title(loaded, found).replace("\n", ", "), _told(found), lambda: figure_of_map(loaded, found))


def map_as_html(loaded: Loaded, found: MobilityMap) -> bytes:
    """The map as a page, with every cell in a table. Raises MissingPartError where Matplotlib is not installed."""
    drawing, outside = drawing_of_map(loaded, found), int((~found.inside_domain).sum())
    warning = f"{outside} of {found.inside_domain.size} cells are outside the model's domain: extrapolated, hatched."
    alias = f" ({loaded.alias})" if loaded.alias else ""
    steepest = zip(found.torque_nm.tolist(), found.steepest_climb_slope_deg, found.steepest_inside_domain, strict=True)
    columns = ("torque_nm", "steepest_climb_slope_deg", "steepest_inside_domain")
    report = Report(
        title=f"Mobility map of a rover of {found.mass_kg:g} kg",
        lead=_lead(found),
        facts={
            "model": f"{loaded.twin.name}@{loaded.twin.version}{alias}",
            "mass, kg": found.mass_kg,
            "horizon, s": found.horizon_s,
            "confidence of the steepest slope": found.confidence,
        },
        sections=[
            Section("The map", [drawing.description], figure=drawing, tables=_tables(found)),
            Section("Steepest slopes", [_STEEPEST], tables=[Table(_confidence(found), columns, list(steepest))]),
        ],
        warning=warning if outside else "",
    )
    return as_html(report)


def figure_of_map(loaded: Loaded, found: MobilityMap) -> Figure:
    """Fields, contours, the line of the steepest slopes; of a single torque or slope, the speed against the other."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - a second that only those pay who ask for a picture

    figure = Figure(figsize=_SIZE_INCHES)
    axes = figure.add_axes((0.095, 0.105, 0.88, 0.76))
    if min(found.inside_domain.shape) > 1:
        _map(axes, found)
    else:
        _line(axes, found)
    axes.set_title(_title(loaded, found), fontsize=10.5, loc="left", pad=22)
    return figure


def _map(axes: Axes, found: MobilityMap) -> None:
    slopes, torques = _edges(found.slope_deg), _edges(found.torque_nm)
    for row, outcomes in enumerate(found.outcome):
        for outcome, first, last in _stretches(outcomes):
            _field(
                axes, slopes[[first, last]], torques[[row, row + 1]], color=_COLOURS[outcome], zorder=1, linewidth=0.6
            )
        for inside, first, last in _stretches(found.inside_domain[row].tolist()):
            if not inside:
                look = {"facecolor": "none", "edgecolor": HATCH, "hatch": "////", "lw": 0}
                _field(axes, slopes[[first, last]], torques[[row, row + 1]], zorder=2, **look)
    _names(axes, found)
    levels = [level for level in _SPEEDS_M_S if found.mean_speed_m_s.min() < level < found.mean_speed_m_s.max()]
    steepest = [np.nan if slope is None else slope for slope in found.steepest_climb_slope_deg]
    axes.plot(steepest, found.torque_nm, "-", color=PAPER, linewidth=5.0, zorder=4)
    axes.plot(steepest, found.torque_nm, "-", color=SECOND, linewidth=2.4, zorder=5, label=_confidence(found))
    size = 4.5 if len(steepest) <= _MANY else 2.5
    for slope, torque, inside in zip(steepest, found.torque_nm, found.steepest_inside_domain, strict=True):
        if slope == slope:
            face = SECOND if inside else PAPER
            axes.plot(slope, torque, "o", color=SECOND, markerfacecolor=face, markersize=size, zorder=6)
    dress(axes, "", "slope, ° (uphill)", "stall torque of each wheel's motor, N m")
    axes.grid(False)
    axes.set_xlim(slopes[0], slopes[-1])
    axes.set_ylim(torques[0], torques[-1])
    if levels:  # last, for their names keep off what is there
        lines = axes.contour(
            found.slope_deg, found.torque_nm, found.mean_speed_m_s, levels, colors=INK, linewidths=0.8, zorder=3
        )
        name_contours(axes, lines, "m/s")
    _legend(axes, found)


def _line(axes: Axes, found: MobilityMap) -> None:
    """The mean speed over slopes or torques, whichever there are several of, on the colours of the outcomes."""
    over_torque = len(found.torque_nm) > 1
    values = found.torque_nm if over_torque else found.slope_deg
    outcomes = [row[0] for row in found.outcome] if over_torque else list(found.outcome[0])
    inside, edges = found.inside_domain.ravel().tolist(), _edges(values)
    for outcome, first, last in _stretches(outcomes):
        axes.axvspan(edges[first], edges[last], facecolor=_COLOURS[outcome], linewidth=0, zorder=0)
        middle = (edges[first] + edges[last]) / 2
        axes.text(middle, 0.96, outcome.value, transform=axes.get_xaxis_transform(), ha="center", va="top")
    for known, first, last in _stretches(inside):
        if not known:
            axes.axvspan(edges[first], edges[last], facecolor="none", edgecolor=HATCH, hatch="////", lw=0, zorder=1)
    axes.plot(values, found.mean_speed_m_s.ravel(), color=INK, linewidth=1.8, marker="o", markersize=3, zorder=3)
    slope = found.steepest_climb_slope_deg[0]
    if not over_torque and slope is not None:
        axes.axvline(slope, color=SECOND, linewidth=2.4, zorder=4, label=f"{_confidence(found)}: {slope:.2f}°")
    one = f"at {found.slope_deg[0]:g}°" if over_torque else f"at {found.torque_nm[0]:g} N m"
    label = "stall torque of each wheel's motor, N m" if over_torque else "slope, ° (uphill)"
    dress(axes, "", label, f"mean speed {one}, m/s")
    axes.set_xlim(edges[0], edges[-1])
    _legend(axes, found)


def _legend(axes: Axes, found: MobilityMap) -> None:
    from matplotlib.patches import Patch  # noqa: PLC0415 - as above

    handles: list[Any] = list(axes.get_legend_handles_labels()[0])
    if not found.inside_domain.all():
        handles.append(Patch(facecolor="none", edgecolor=HATCH, hatch="////", linewidth=0, label="outside the domain"))
    axes.legend(
        handles=handles, frameon=False, fontsize=8.5, loc="lower left", bbox_to_anchor=(-0.01, 0.995), ncols=3,
        borderaxespad=0.2,
    )  # fmt: skip


def _names(axes: Axes, found: MobilityMap) -> None:
    """The name of each outcome in the widest stretch of its cells, if there is room."""
    for outcome in Outcome:
        cells = np.array([[each is outcome for each in row] for row in found.outcome])
        if cells.mean() < _SMALLEST_FIELD:
            continue
        row, first, last = max(
            ((row, first, last) for row in range(len(cells)) for held, first, last in _stretches(cells[row]) if held),
            key=lambda each: (_depth(cells, *each), each[2] - each[1]),
        )
        slope = (found.slope_deg[first] + found.slope_deg[last - 1]) / 2
        box = {"boxstyle": "round,pad=0.2", "facecolor": _COLOURS[outcome], "edgecolor": "none"}
        axes.text(
            slope, found.torque_nm[row], outcome.value, ha="center", va="center", fontsize=11, fontweight="bold",
            zorder=7, bbox=box,
        )  # fmt: skip


def _depth(cells: np.ndarray[Any, np.dtype[np.bool_]], row: int, first: int, last: int) -> int:
    """How far the middle of a stretch is from the border of its field, in cells."""
    middle = (first + last - 1) // 2
    column = cells[:, middle]
    above = int(np.argmin(np.append(column[row:], False)))
    below = int(np.argmin(np.append(column[row::-1], False)))
    return min(above, below, 2 * (last - first))


def _field(axes: Axes, slopes: Array, torques: Array, **look: Any) -> None:  # noqa: ANN401 - the look of a patch
    from matplotlib.patches import Rectangle  # noqa: PLC0415 - as above

    corner, size = (slopes[0], torques[0]), (slopes[1] - slopes[0], torques[1] - torques[0])
    axes.add_patch(Rectangle(corner, *size, **look))


def _stretches(values: Sequence[Any]) -> list[tuple[Any, int, int]]:
    """Neighbours that are equal: the value, the first index, one after the last."""
    found, begin = [], 0
    for value, group in groupby(values):
        end = begin + len(list(group))
        found.append((value, begin, end))
        begin = end
    return found


def _edges(middles: Array) -> Array:
    """Borders of cells around evenly spaced middles, one more than these."""
    half = (middles[1] - middles[0]) / 2 if len(middles) > 1 else max(0.5, 0.05 * abs(float(middles[0])))
    return np.append(middles - half, middles[-1] + half)


def _title(loaded: Loaded, found: MobilityMap) -> str:
    return (
        f"Where a rover of {found.mass_kg:g} kg climbs, stalls and slides\n"
        f"{loaded.twin.name}@{loaded.twin.version}, {found.horizon_s:g} s from rest"
    )


def _confidence(found: MobilityMap) -> str:
    if found.confidence is None:
        return "steepest slope climbed (central estimate: no band)"
    return f"steepest slope climbed with {100 * found.confidence:.3g} % confidence"


def _lead(found: MobilityMap) -> str:
    known = [slope for slope in found.steepest_climb_slope_deg if slope is not None]
    if not known:
        return "On this map the rover climbs none of the slopes with the confidence asked for."
    row = int(np.argmax([-np.inf if slope is None else slope for slope in found.steepest_climb_slope_deg]))
    sure = "by the central estimate" if found.confidence is None else f"with {100 * found.confidence:.3g} % confidence"
    return f"The rover climbs up to {max(known):.2f}° {sure}, at {found.torque_nm[row]:g} N m per wheel."


def _told(found: MobilityMap) -> str:
    counts = {outcome: sum(row.count(outcome) for row in found.outcome) for outcome in Outcome}
    cells = ", ".join(f"{outcome.value} in {count}" for outcome, count in counts.items() if count)
    return (
        f"A map of slopes from {found.slope_deg[0]:g} to {found.slope_deg[-1]:g} degrees and torques from "
        f"{found.torque_nm[0]:g} to {found.torque_nm[-1]:g} N m, {found.inside_domain.size} cells: the rover {cells}. "
        f"Contours are the mean speed along the slope. {_lead(found)}"
    )


def _tables(found: MobilityMap) -> list[Table]:
    """Every cell: outcome, speed and slip over slope x torque, as the CSV answer has them."""
    columns = ("torque_nm", "slope_deg", "outcome", "mean_speed_m_s", "slip_ratio", "inside_domain")
    rows: list[tuple[Cell, ...]] = [
        (
            torque, slope, found.outcome[row][column].value, float(found.mean_speed_m_s[row, column]),
            found.slip_ratio[row][column], bool(found.inside_domain[row, column]),
        )
        for row, torque in enumerate(found.torque_nm.tolist())
        for column, slope in enumerate(found.slope_deg.tolist())
    ]  # fmt: skip
    return [Table(f"All {len(rows)} cells", columns, rows)]


_STEEPEST = (
    "For each torque, the slope up to which every slope of the map is climbed. It is never above the steepest slope of "
    "the map. None where the lowest slope is not climbed, or where no cell of the torque is inside the domain."
)
