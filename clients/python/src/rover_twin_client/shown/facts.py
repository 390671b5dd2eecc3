"""What an answer tells about itself, before it becomes a table, a figure or a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from numpy.typing import NDArray

Column: TypeAlias = NDArray[Any]
Variable: TypeAlias = tuple[tuple[str, ...], Column]
"""Names of the axes, and an array with as many."""
_COMPOUND = (("_rad_s", "rad/s"), ("_m_s", "m/s"))
_UNITS = {"m": "m", "s": "s", "deg": "degree", "kg": "kg", "nm": "N m", "j": "J"}


def unit_of(name: str) -> str | None:
    """The unit that stands at the end of a name, None for words, flags and ratios."""
    for ending, unit in _COMPOUND:
        if name.endswith(ending):
            return unit
    return _UNITS.get(name.rpartition("_")[2]) if "_" in name else None


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns (N,) of one long table, and the same as variables over named axes, `coordinates` among them.

    `about` are plain values that hold for all rows.
    """

    columns: Mapping[str, Column]
    variables: Mapping[str, Variable]
    coordinates: Mapping[str, Variable]
    about: Mapping[str, str | float]


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A curve for a small picture: values over `across`, with an interval where there is one."""

    across: Column
    values: Column
    lower: Column | None = None
    upper: Column | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """The `title` and `rows` of a small page, and its picture: curves, or a `grid` of words, a row for each (T, S)."""

    title: str
    rows: tuple[tuple[str, str], ...]
    lines: tuple[Line, ...] = ()
    grid: Column | None = None
    caption: str = ""
    colours: Mapping[str, str] = field(default_factory=dict)


def over_time(columns: Mapping[str, Column | None], about: Mapping[str, str | float]) -> Table:
    """The table of one trajectory: `time_s` is the axis, columns that are None are left out."""
    known = {name: column for name, column in columns.items() if column is not None}
    axis: tuple[str, ...] = ("time_s",)
    variables: dict[str, Variable] = {name: (axis, column) for name, column in known.items() if name != "time_s"}
    return Table(known, variables, {"time_s": (axis, known["time_s"])}, about)


def span(value: float, lower: Column | None, upper: Column | None, level: float | None) -> str:
    """A length, with its interval where there is one."""
    if lower is None or upper is None or level is None:
        return f"{value:.3f} m"
    return f"{value:.3f} m ({lower[-1]:.3f} to {upper[-1]:.3f} m at {level:.0%})"
