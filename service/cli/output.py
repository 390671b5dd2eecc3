"""Where words go: answers to stdout, so that they can be piped; notes and progress to stderr.

Rich is imported by whoever shows a table, not by a service that starts.
"""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

# A table that is piped has no screen to fit: wide enough that no cell is folded.
_PIPED_WIDTH = 240
SECONDS_BETWEEN_NOTES = 10.0
"""How often progress is told in lines, where no terminal shows a bar."""


def print_json(content: object) -> None:
    """One JSON document on stdout. NaN and infinities are refused: they are not JSON."""
    print(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False))


def print_answer(answer: RenderableType) -> None:
    """Text or a table on stdout; colours only where a terminal shows them."""
    from rich.console import Console

    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else _PIPED_WIDTH, highlight=False)
    console.print(answer, markup=False)


def note(text: str) -> None:
    """A line for people on stderr."""
    print(text, file=sys.stderr, flush=True)


def make_table(*columns: str, left: int = 1) -> Table:
    """A plain table; the first `left` columns hold text, the others numbers."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index < left else "right", overflow="fold")
    return table


def titled(title: str, table: Table) -> RenderableType:
    """A table under its title. (Rich's own titles are folded to the width of the table.)"""
    from rich.console import Group
    from rich.text import Text

    return Group(Text(title, style="bold"), table)
