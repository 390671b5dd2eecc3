"""Showing work on many files on stderr: a bar on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from service.cli.output import SECONDS_BETWEEN_NOTES, note

Report = Callable[[int, int, str], None]


@contextmanager
def file_progress(verb: str) -> Iterator[Report]:
    """Yields what to call before each file with (files done, files in all, file)."""
    if not sys.stderr.isatty():
        yield _lines(verb)
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeRemainingColumn(compact=True),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(verb, total=None)
        yield lambda done, total, file: bar.update(task, completed=done, total=total, description=f"{verb} {file}")


def _lines(verb: str) -> Report:
    last = time.monotonic()

    def report(done: int, total: int, file: str) -> None:
        nonlocal last
        if time.monotonic() - last >= SECONDS_BETWEEN_NOTES:
            last = time.monotonic()
            note(f"{verb} {file}, {done} of {total} done")

    return report
