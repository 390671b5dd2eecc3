"""What a running job tells: its stream of events, and a note of where it stands. Written from inside its steps."""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime
from typing import Any

from dbos import DBOS

from service.jobs.job import EVENTS, STATUS, EventKind, JobProgress
from service.learning.network.fit import FitProgress

_LEAST_PAUSE_S = 0.5
# Pauses grow with the age of the job, which bounds its events: about 2,000 in a day.
_PAUSE_PER_S = 1 / 240
_MOST_CHARACTERS = 1000
# Where in a job each phase begins, as a share of the whole.
_SHARES = {"loading": 0.0, "fitting": 0.05, "evaluating": 0.85, "publishing": 0.95, "judging": 0.98, "done": 1.0}


class JobReport:
    """Events of one attempt at a job. Every method writes to the database, so it waits while that is away."""

    def __init__(self, started_at: str | None) -> None:
        self._started_at = started_at or _now()
        self._began = time.monotonic()
        self._last = 0.0

    def began(self, attempt: int) -> None:
        """A worker took the job up."""
        self._event("state", {"state": "running", "attempt": attempt})
        self._note(None)

    def log(self, message: str) -> None:
        """A line for people."""
        self._event("log", {"message": message[:_MOST_CHARACTERS]})

    def phase(self, phase: str, part: float) -> None:
        """The job is `part` of the way through a phase."""
        self._progress(JobProgress(phase=phase, fraction=_share(phase, part)))

    def epoch(self, reached: FitProgress) -> None:
        """An epoch of the fit is finished; told when enough time has passed since the last progress."""
        now = time.monotonic()
        if now - self._last < max(_LEAST_PAUSE_S, (now - self._began) * _PAUSE_PER_S):
            return
        progress = JobProgress(
            phase="fitting",
            fraction=_share("fitting", reached.epoch / reached.epochs),
            epoch=reached.epoch,
            epochs=reached.epochs,
            train_error_m=math.sqrt(reached.train_loss_m2),
            validation_error_m=math.sqrt(reached.validation_loss_m2),
            eta_s=reached.remaining_s,
        )
        self._progress(progress)

    def _progress(self, progress: JobProgress) -> None:
        self._last = time.monotonic()
        self._event("progress", progress.model_dump(mode="json"))
        self._note(progress)

    def _event(self, kind: EventKind, data: dict[str, Any]) -> None:
        DBOS.write_stream(EVENTS, {"kind": kind, "time": _now(), "data": data})

    def _note(self, progress: JobProgress | None) -> None:
        note = progress.model_dump(mode="json") if progress else None
        DBOS.set_event(STATUS, {"started_at": self._started_at, "progress": note})


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _share(phase: str, part: float) -> float:
    """The share of a job that is done, `part` of the way through a phase."""
    phases = list(_SHARES)
    start = _SHARES[phase]
    end = _SHARES[phases[min(phases.index(phase) + 1, len(phases) - 1)]]
    return start + (end - start) * min(max(part, 0.0), 1.0)
