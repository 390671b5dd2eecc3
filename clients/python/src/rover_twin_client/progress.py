"""Tells how far a long call is: by a bar or a counter in words, or by a function of the caller."""

from __future__ import annotations

import importlib
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, TypeAlias

Progress: TypeAlias = bool | Callable[[int, int], None]
"""True for a bar (a text without tqdm and rich), or a function that is called with how many are done, of how many."""
_EVERY_S = 0.5


@contextmanager
def reporting(progress: Progress, total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """Gives a function to be called with how many more are done."""
    if callable(progress):
        yield _counted(progress, total)
    elif not progress:
        yield lambda _: None
    else:
        with _bar(total, unit) as more:
            yield more


def _counted(tell: Callable[[int, int], None], total: int) -> Callable[[int], None]:
    done = 0

    def count(more: int) -> None:
        nonlocal done
        done += more
        tell(done, total)

    return count


@contextmanager
def _bar(total: int, unit: str) -> Iterator[Callable[[int], None]]:
    if (tqdm := _tqdm()) is not None:
        with tqdm(total=total, unit=f" {unit}") as bar:
            yield bar.update
        return
    try:
        rich = importlib.import_module("rich.progress")  # only who wants a bar waits for it
    except ImportError:
        with _line(total, unit) as tell:
            yield tell
        return
    with rich.Progress() as bar:
        task = bar.add_task(unit, total=total)
        yield lambda more: bar.advance(task, more)


def _tqdm() -> Callable[..., AbstractContextManager[Any]] | None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that of a notebook without widgets: then it writes text
            bar: Callable[..., AbstractContextManager[Any]] = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        return None
    return bar


@contextmanager
def _line(total: int, unit: str) -> Iterator[Callable[[int], None]]:
    """One line of text on standard error, written anew."""
    done, told = 0, 0.0

    def tell(more: int) -> None:
        nonlocal done, told
        done += more
        if done == total or time.monotonic() - told > _EVERY_S:
            told = time.monotonic()
            sys.stderr.write(f"\r{done} of {total} {unit}")
            sys.stderr.flush()

    try:
        yield tell
    finally:
        if told:
            sys.stderr.write("\n")
