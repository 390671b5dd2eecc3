"""Answers as small pieces of HTML for notebooks: one table and one picture, nothing from elsewhere, all texts escaped.

Colours are those of the page around it, dark or light, but for the curve.
"""

from __future__ import annotations

from html import escape
from itertools import groupby

import numpy as np

from rover_twin_client.shown.facts import Column, Facts, Line

WIDTH, HEIGHT, EDGE = 240, 72, 4
MOST_POINTS = 240  # a picture of that many pixels shows no more
MOST_LINES = 60
CURVE = "#1f77b4"


def page(facts: Facts) -> str:
    """The page of one answer."""
    rows = "".join(
        f'<tr><th style="text-align:left;font-weight:normal;opacity:.7">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(value)}</td></tr>'
        for name, value in facts.rows
    )
    picture = _grid(facts) if facts.grid is not None else _curves(facts)
    return (
        '<div style="display:flex;gap:1.5em;align-items:center;flex-wrap:wrap">'
        f'<table style="color:inherit"><caption style="text-align:left"><b>{escape(facts.title)}</b></caption>'
        f"{rows}</table>{picture}</div>"
    )


def _curves(facts: Facts) -> str:
    lines = [line for line in facts.lines[:MOST_LINES] if np.isfinite(line.values).any()]
    if not lines:
        return ""
    every = [
        np.concatenate([part for part in (line.values, line.lower, line.upper) if part is not None]) for line in lines
    ]
    bottom, top = _ends(np.concatenate(every))
    left, right = _ends(np.concatenate([line.across for line in lines]))

    def points(line: Line, values: Column) -> list[str]:
        at = np.unique(np.linspace(0, values.size - 1, min(values.size, MOST_POINTS)).astype(int))
        x = EDGE + (line.across[at] - left) / (right - left) * (WIDTH - 2 * EDGE)
        y = HEIGHT - EDGE - (values[at] - bottom) / (top - bottom) * (HEIGHT - 2 * EDGE)
        return [f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True) if np.isfinite(a) and np.isfinite(b)]

    shapes, width = "", 1.5 if len(lines) < 5 else 0.5
    for line in lines:
        if line.lower is not None and line.upper is not None:
            around = points(line, line.lower) + points(line, line.upper)[::-1]
            shapes += f'<polygon points="{" ".join(around)}" fill="{CURVE}" fill-opacity=".2"/>'
        curve = " ".join(points(line, line.values))
        shapes += f'<polyline points="{curve}" fill="none" stroke="{CURVE}" stroke-width="{width}"/>'
    return _picture(shapes, facts.caption)


def _grid(facts: Facts) -> str:
    """A map of words: runs of the same word in a row become one rectangle; the first row is at the bottom."""
    assert facts.grid is not None
    rows, columns = facts.grid.shape
    width, height = (WIDTH - 2 * EDGE) / columns, (HEIGHT - 2 * EDGE) / rows
    shapes = ""
    for row in range(rows):
        at, y = 0, HEIGHT - EDGE - (row + 1) * height
        for word, run in groupby(facts.grid[row].tolist()):
            count = len(list(run))
            place = f'x="{EDGE + at * width:.1f}" y="{y:.1f}" width="{count * width:.1f}" height="{height:.1f}"'
            shapes += f'<rect {place} shape-rendering="crispEdges" fill="{facts.colours.get(word, "#999999")}"/>'
            at += count
    return _picture(shapes, facts.caption)


def _picture(shapes: str, caption: str) -> str:
    label = escape(caption, quote=True)
    return (
        f'<figure style="margin:0"><svg role="img" aria-label="{label}" width="{WIDTH}" height="{HEIGHT}" '
        f'viewBox="0 0 {WIDTH} {HEIGHT}">{shapes}</svg>'
        f'<figcaption style="opacity:.7">{escape(caption)}</figcaption></figure>'
    )


def _ends(values: Column) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    lowest, highest = float(known.min()), float(known.max())
    return (lowest, highest) if highest > lowest else (lowest - 0.5, lowest + 0.5)
