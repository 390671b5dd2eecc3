"""Showing a training job on stderr as its events come: a live bar on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Mapping
from datetime import timedelta
from typing import Any, Protocol, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.text import Text

from service.cli.output import SECONDS_BETWEEN_NOTES, note


class JobProgressView(Protocol):
    """What the events of a job tell; use it as a context."""

    def state(self, state: str) -> None:
        """The job has come into this state."""

    def progress(self, reached: Mapping[str, Any]) -> None:
        """The job has come so far: the members of a `JobProgress`."""

    def log(self, text: str) -> None:
        """The job has said something."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


def make_view() -> JobProgressView:
    """The kind that suits stderr."""
    return LiveView() if sys.stderr.isatty() else PlainView()


def errors_of(reached: Mapping[str, Any]) -> str:
    """The errors so far and the time left, as far as they are known: "train 1.234 validation 2.345 cm rms"."""
    known = [
        f"{name} {100 * reached[field]:.3f}"
        for name, field in (("train", "train_error_m"), ("validation", "validation_error_m"))
        if reached.get(field) is not None
    ]
    return " ".join(known) + " cm rms" if known else ""


def epochs_of(reached: Mapping[str, Any]) -> str:
    """Epochs done and to do, empty in phases that have none: "epoch 12/200"."""
    return f"epoch {reached['epoch']}/{reached['epochs']}" if reached.get("epochs") else ""


def time_left_of(reached: Mapping[str, Any]) -> str:
    """The time left, empty while nobody knows: "0:01:30 left"."""
    seconds = reached.get("eta_s")
    return "" if seconds is None else f"{timedelta(seconds=round(seconds))} left"


class PlainView:
    """A line at each state, phase and log line, and every ten seconds in between."""

    def __init__(self) -> None:
        self._phase: str | None = None
        self._last = -math.inf

    def state(self, state: str) -> None:
        """The job has come into this state."""
        note(state)

    def progress(self, reached: Mapping[str, Any]) -> None:
        """The job has come so far."""
        now = time.monotonic()
        if reached["phase"] == self._phase and now - self._last < SECONDS_BETWEEN_NOTES:
            return
        self._phase, self._last = reached["phase"], now
        parts = (
            f"{100 * reached['fraction']:.0f} %",
            reached["phase"],
            epochs_of(reached),
            errors_of(reached),
            time_left_of(reached),
        )
        note(", ".join(part for part in parts if part))

    def log(self, text: str) -> None:
        """The job has said something."""
        note(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None


class LiveView:
    """One bar over the whole job with phase, epochs, errors and the time left; log lines scroll above it."""

    def __init__(self) -> None:
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            TaskProgressColumn(),
            TextColumn("{task.fields[details]}", markup=False),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task("waiting", total=1.0, details="")

    def state(self, state: str) -> None:
        """The job has come into this state."""
        self._bar.update(self._task, description=state)

    def progress(self, reached: Mapping[str, Any]) -> None:
        """The job has come so far."""
        details = " ".join(filter(None, (epochs_of(reached), errors_of(reached), time_left_of(reached))))
        self._bar.update(self._task, description=reached["phase"], completed=reached["fraction"], details=details or "")

    def log(self, text: str) -> None:
        """The job has said something."""
        self._bar.console.print(Text(text))

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
