"""Answers as figures of matplotlib."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rover_twin_client.errors import FieldFault, InvalidInputError
from rover_twin_client.shown.facts import Column, unit_of
from rover_twin_client.shown.tables import needed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WORD = "plot"
COLOURS = {"climbs": "#2a9d8f", "stalls": "#e9c46a", "slides": "#c8553d"}
"""Of the outcomes, also in pages."""


def axes_or_new(ax: Axes | None) -> Axes:
    """The axes, or those of a new figure."""
    if ax is not None:
        return ax
    new: Axes = needed("matplotlib.pyplot", WORD).subplots(layout="constrained")[1]
    return new


def chosen(columns: Mapping[str, Column], name: str) -> Column:
    """The column of this name; raises InvalidInputError with the names that there are."""
    if name not in columns or name == "time_s":
        allowed = "one of " + ", ".join(each for each in columns if each != "time_s")
        message = f"column is {name!r}, allowed is {allowed}"
        raise InvalidInputError(message, faults=(FieldFault("column", name, allowed, message),))
    return columns[name]


def over_time(
    ax: Axes | None,
    title: str,
    time_s: Column,
    name: str,
    values: Column,
    *,
    prior: Column | None = None,
    interval: tuple[Column, Column, float] | None = None,
) -> Axes:
    """One quantity over time, with prior and band where there are any."""
    axes = axes_or_new(ax)
    (curve,) = axes.plot(time_s, values, label="prediction")
    if interval is not None:
        lower, upper, level = interval
        axes.fill_between(
            time_s, lower, upper, alpha=0.2, color=curve.get_color(), linewidth=0, label=f"{level:.0%} band"
        )
    if prior is not None:
        axes.plot(time_s, prior, linestyle="--", color="grey", label="prior")
    if interval is not None or prior is not None:
        axes.legend()
    return labelled(axes, title, "time_s", name)


def many_over_time(ax: Axes | None, title: str, time_s: Column, name: str, values: Column) -> Axes:
    """One quantity over time, a thin curve for each row (N, T)."""
    axes = axes_or_new(ax)
    times = np.broadcast_to(time_s, values.shape)
    axes.plot(times.T, values.T, linewidth=0.8, alpha=max(0.05, min(1.0, 20 / max(len(values), 1))), color="C0")
    return labelled(axes, title, "time_s", name)


def grid(ax: Axes | None, title: str, across: Column, up: Column, words: Column, names: tuple[str, str]) -> Axes:
    """A map of outcomes (T, S); `across` (S,) and `up` (T,) with their `names`."""
    axes = axes_or_new(ax)
    kinds = [word for word in COLOURS if (words == word).any()]
    colours = needed("matplotlib.colors", WORD).ListedColormap([COLOURS[word] for word in kinds])
    numbers = np.select([words == word for word in kinds], range(len(kinds)), default=np.nan).astype(float)
    axes.pcolormesh(
        across, _rows(up), _doubled(up, numbers), cmap=colours, vmin=-0.5, vmax=len(kinds) - 0.5, shading="nearest"
    )
    patch = needed("matplotlib.patches", WORD).Patch
    axes.legend(handles=[patch(color=COLOURS[word], label=word) for word in kinds], loc="upper left")
    return labelled(axes, title, names[0], names[1])


def labelled(axes: Axes, title: str, across: str, up: str) -> Axes:
    """With a title, and the units of both axes."""
    axes.set_title(title)
    axes.set_xlabel(label_of(across))
    axes.set_ylabel(label_of(up))
    return axes


def label_of(name: str) -> str:
    """`speed_m_s` as "speed (m/s)"."""
    unit = unit_of(name)
    if unit is None:
        return name.replace("_", " ")
    suffix = {"m/s": "_m_s", "rad/s": "_rad_s", "N m": "_nm", "degree": "_deg"}.get(unit, f"_{unit.lower()}")
    return f"{name.removesuffix(suffix).replace('_', ' ')} ({unit})"


def _rows(up: Column) -> Column:
    """pcolormesh needs the width of a row: a lone one gets one of its own."""
    return up if up.size > 1 else np.array([up[0] - 0.5, up[0] + 0.5])


def _doubled(up: Column, numbers: Column) -> Column:
    return numbers if up.size > 1 else np.repeat(numbers, 2, axis=0)
