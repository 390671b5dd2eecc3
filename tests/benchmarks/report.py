"""Numbers into Markdown: tables, bars, and the page they are kept on."""

from __future__ import annotations

import re
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "performance.md"
_HEAD = """# Performance

Measured, not promised: each program replaces its part of this page. Numbers of different machines cannot be compared;
the ratios, each to a floor measured in the same run, mostly can.
"""


@dataclass(frozen=True, slots=True)
class Sample:
    """Times of one thing, ms."""

    values: Sequence[float]

    @property
    def p50(self) -> float:
        """The median."""
        return statistics.median(self.values)

    @property
    def p90(self) -> float:
        """Nine of ten were no longer."""
        return statistics.quantiles(self.values, n=10)[-1] if len(self.values) > 1 else self.values[0]


@dataclass(frozen=True, slots=True)
class Bar:
    """Something measured beside what was promised: at most `limit`, or at least."""

    what: str
    value: float
    limit: float
    at_least: bool = False

    @property
    def held(self) -> bool:
        """Whether the promise is kept."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def row(self) -> list[object]:
        """Its row of `bars_table`."""
        sign = "≥" if self.at_least else "≤"
        return [self.what, self.value, f"{sign} {self.limit:g}", "yes" if self.held else "**no**"]


def bars_table(bars: Iterable[Bar]) -> str:
    """What was promised, measured, and whether it holds."""
    return table(("what", "measured", "bar", "held"), (bar.row() for bar in bars))


def table(names: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; numbers stand right."""
    cells = [[cell(value) for value in row] for row in rows]
    right = ["---" if column == 0 else "---:" for column in range(len(names))]
    return "\n".join(f"| {' | '.join(row)} |" for row in [list(names), right, *cells])


def cell(value: object) -> str:
    """Three significant digits, thousands with commas."""
    if isinstance(value, float):
        digits = f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
        return f"{float(digits):g}" if "e" in digits else digits
    return f"{value:,}" if isinstance(value, int) else str(value)


def write_part(name: str, markdown: str, page: Path = PAGE) -> None:
    """Replace one part of the page, or add it; the others stay as they are."""
    text = page.read_text(encoding="utf-8") if page.exists() else _HEAD
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    part = f"{begin}\n\n{markdown.strip()}\n\n{end}"
    old = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    text = old.sub(lambda _: part, text) if old.search(text) else f"{text.rstrip()}\n\n{part}\n"
    page.write_text(text, encoding="utf-8")
