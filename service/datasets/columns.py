"""The columns that a run may have: unit, meaning, plausible range, stored digits and names seen in the wild."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Column:
    """One canonical column. Values outside `lowest..highest` cannot be what the name says.

    `digits` are the decimals that are kept when stored; nine decimal digits fit in all (see `parquet`), so
    six of them leave room up to 999.999999.
    """

    name: str
    unit: str
    meaning: str
    lowest: float
    highest: float
    digits: int
    aliases: tuple[str, ...] = ()

    @property
    def scale(self) -> float:
        """Stored integers per unit."""
        return 10.0**self.digits


# Ranges: a run lasts at most 600 s (the service's own horizon limit) and stays within what nine digits hold;
# a rover that is not on its side pitches less than 1.6 rad; wheel heights, speeds and spins are far beyond any
# planetary rover (VIPER: 0.25 m, 0.8 m/s, pi rad/s), so that only a wrong unit or a wrong column goes outside.
# Digits: 0.1 micrometre and 0.1 microradian are below Chrono's own repeatability and cost 0.7-1.0 byte a value.
COLUMNS: tuple[Column, ...] = (
    Column("time_s", "s", "time since the motors were switched on", 0.0, 601.0, 6,
           ("time", "t", "t_s", "time_sec", "time_seconds", "sim_time", "sim_time_s")),
    Column("rear_x_m", "m", "rear wheel centre along the slope, positive uphill", -99.0, 99.0, 7),
    Column("rear_y_m", "m", "rear wheel centre above the undeformed surface", -5.0, 5.0, 7),
    Column("front_x_m", "m", "front wheel centre along the slope, same origin", -99.0, 99.0, 7),
    Column("front_y_m", "m", "front wheel centre above the undeformed surface", -5.0, 5.0, 7),
    Column("pitch_rad", "rad", "chassis pitch relative to the slope, nose up positive", -1.6, 1.6, 7),
    Column("speed_mps", "m/s", "speed along the slope", -10.0, 10.0, 6, ("speed_m_s",)),
    Column("rear_omega_radps", "rad/s", "rear wheel spin, positive uphill", -1000.0, 1000.0, 5,
           ("rear_omega_rad_s",)),
    Column("front_omega_radps", "rad/s", "front wheel spin, positive uphill", -1000.0, 1000.0, 5,
           ("front_omega_rad_s",)),
    Column("rear_lateral_m", "m", "sideways position of the rear wheel", -99.0, 99.0, 6),
    # what acted on the rover, where it changes within the run; the ranges are those of scenarios (see `run_table`)
    Column("slope_deg", "deg", "slope that acts at this time, positive uphill", -45.0, 45.0, 7,
           ("slope_angle_deg", "slope_degrees")),
    Column("torque_nm", "N m", "stall torque of each wheel's motor at this time; 0: motors off, wheels free",
           0.0, 10_000.0, 4, ("torque_n_m", "stall_torque_nm", "stall_torque_n_m")),
    Column("brake", "1", "1: motors off and wheels locked; 0: not", 0.0, 1.0, 0, ("brakes", "brake_on")),
)  # fmt: skip

INPUTS: tuple[str, ...] = ("slope_deg", "torque_nm", "brake")
"""Columns that say what acted on the rover: a run has them only where they change, else its scenario says it."""

BY_NAME: dict[str, Column] = {column.name: column for column in COLUMNS}
REQUIRED: tuple[str, ...] = ("time_s", "rear_x_m", "rear_y_m")
MAX_COLUMNS = 256

LABELS: tuple[str, ...] = ("run", "set", "mass_kg", "horizon_s", "file", "step_s")
"""What a table of runs, or of their rows, may say beside the columns of a run."""

_CANONICAL: dict[str, str] = {alias: c.name for c in COLUMNS for alias in (c.name, *c.aliases)}
_MEANINGS: dict[str, str] = _CANONICAL | {label: label for label in LABELS}


def canonical_name(header: str) -> str | None:
    """The canonical column that a header cell names without doubt ("Time (s)", "rear x [m]"), or None.

    Bare `x`, `y`, `z` are None on purpose: which of them is vertical differs from demo to demo; a
    `ColumnMap` says it.
    """
    return _CANONICAL.get(_plain(header))


def meaning_of(header: str) -> str | None:
    """The canonical column or the label that a header cell names without doubt ("Mass [kg]", "run"), or None."""
    return _MEANINGS.get(_plain(header))


LONGEST_NAME = 200
"""Characters of a header cell; a longer one names nothing."""

_QUOTES = ('""', "''", "\u201c\u201d", "\u201e\u201c", "\u2018\u2019", "\u00ab\u00bb")
_UNSEEN = re.compile("[\ufeff\u200b\u200e\u200f\u00ad\u2060]")
# what may stand between words and around units; any other character may be part of a unit, so that nothing is guessed
_BETWEEN = re.compile(r"[\s_\-/.,:()\[\]{}*^\u00b7\u22c5\u2010-\u2014\u2212]+")
_WORDS = re.compile(r"[a-z0-9_]*")


def unquoted(cell: str) -> str:
    """A header cell without spaces and pairs of quotes around it, "" for one that is too long to be a name."""
    text = cell.strip()
    while len(text) > 1 and text[0] + text[-1] in _QUOTES and len(text) <= LONGEST_NAME:
        text = text[1:-1].strip()
    return text if len(text) <= LONGEST_NAME else ""


def _plain(header: str) -> str:
    """The words of a header cell, joined by _, or "" where a character of it may say something else."""
    text = _UNSEEN.sub("", unquoted(header)).lower()
    if text.startswith(("-", "\u2212")):
        return ""
    for written, word in (("rad/s", "radps"), ("m/s", "mps"), ("\u00b0", "deg"), ("\u00ba", "deg")):
        text = text.replace(written, word)
    plain = _BETWEEN.sub("_", text).strip("_")
    return plain if _WORDS.fullmatch(plain) else ""


def is_plain(text: str) -> bool:
    """Whether a part of a header has only letters from a to z, digits, and what may stand between words."""
    return bool(_plain(text))
