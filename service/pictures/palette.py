"""The colours of every picture, by name: on white, and on a dark page.

All pairs can be told apart by colour-blind readers (after Okabe and Ito), and `CLIMBS`, `STALLS`, `SLIDES` darken in
this order, so that they can be told apart in grey as well. No two names share a colour: a report finds them again in a
drawing by their colour, and gives each its name, so that the page's theme decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

PAPER, INK, FAINT, GRID, SHADE = "#fffffe", "#1b1c1e", "#6a6d72", "#dcdddf", "#ececee"
FIRST, SECOND, MARK = "#007a5a", "#0072b2", "#c2500a"
CLIMBS, STALLS, SLIDES = "#d3ebf5", "#f0c04a", "#c9623a"
HATCH = "#4b4e54"

THEMES: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "paper": (PAPER, "#15181c"),
        "ink": (INK, "#e9eaec"),
        "faint": (FAINT, "#a3a8af"),
        "grid": (GRID, "#363b42"),
        "shade": (SHADE, "#262b31"),
        "first": (FIRST, "#43c79f"),
        "second": (SECOND, "#6cb4f2"),
        "mark": (MARK, "#ff9b62"),
        "climbs": (CLIMBS, "#1d4558"),
        "stalls": (STALLS, "#8a6a12"),
        "slides": (SLIDES, "#a5482a"),
        "hatch": (HATCH, "#c4c8ce"),
    }
)
"""Name of a colour in a style sheet, the colour on white, the colour on a dark page."""
