"""Showing a training on stderr: a live bar on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import math
import sys
import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from service.cli.output import SECONDS_BETWEEN_NOTES, note
from service.learning.network.fit import FitProgress


def make_progress() -> LiveProgress | PlainProgress:
    """The kind that suits stderr; use it as a context."""
    return LiveProgress() if sys.stderr.isatty() else PlainProgress()


def rms_cm(loss_m2: float) -> float:
    """Root of the loss, equation (4): the rms distance between predicted and simulated positions, cm."""
    return 100.0 * math.sqrt(loss_m2)


class PlainProgress:
    """A line at each phase, after the first and the last epoch, and every ten seconds in between."""

    def __init__(self) -> None:
        self._last = -math.inf

    def phase(self, text: str) -> None:
        """A phase begins."""
        note(text)

    def epoch(self, progress: FitProgress) -> None:
        """An epoch is finished."""
        now = time.monotonic()
        if progress.epoch < progress.epochs and now - self._last < SECONDS_BETWEEN_NOTES:
            return
        self._last = now
        note(
            f"epoch {progress.epoch}/{progress.epochs}: train {rms_cm(progress.train_loss_m2):.3f} cm rms, "
            f"validation {rms_cm(progress.validation_loss_m2):.3f} cm rms, best epoch {progress.best_epoch}, "
            f"{progress.remaining_s:.0f} s left at most"
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        return None


class LiveProgress:
    """A bar with losses and the time left."""

    def __init__(self) -> None:
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TextColumn("{task.fields[losses]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task: TaskID | None = None

    def phase(self, text: str) -> None:
        """A phase begins."""
        self._bar.console.print(text, highlight=False)

    def epoch(self, progress: FitProgress) -> None:
        """An epoch is finished."""
        losses = (
            f"train {rms_cm(progress.train_loss_m2):.3f} validation {rms_cm(progress.validation_loss_m2):.3f} cm rms"
        )
        if self._task is None:
            self._task = self._bar.add_task("epoch", total=progress.epochs, losses=losses)
        self._bar.update(self._task, completed=progress.epoch, losses=losses)

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
