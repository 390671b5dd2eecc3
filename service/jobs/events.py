"""What a running job tells: its stream of events, and a note of where it stands. Written from inside its steps."""

from __future__ import annotations

import time
from datetime import UTC, datetime
from typing import Any

from dbos import DBOS

from service.jobs.job import EVENTS, STATUS, EventKind, JobProgress

_LEAST_PAUSE_S = 0.5
# Pauses grow with the age of the job, which bounds its events: about 2,000 in a day.
_PAUSE_PER_S = 1 / 240
_MOST_CHARACTERS = 1000


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

    def progress(self, progress: JobProgress) -> None:
        """Where the job stands, whatever was said last."""
        self._last = time.monotonic()
        self._event("progress", progress.model_dump(mode="json"))
        self._note(progress)

    def is_time(self) -> bool:
        """Whether enough time has passed for another progress."""
        now = time.monotonic()
        return now - self._last >= max(_LEAST_PAUSE_S, (now - self._began) * _PAUSE_PER_S)

    def _event(self, kind: EventKind, data: dict[str, Any]) -> None:
        DBOS.write_stream(EVENTS, {"kind": kind, "time": _now(), "data": data})

    def _note(self, progress: JobProgress | None) -> None:
        note = progress.model_dump(mode="json") if progress else None
        DBOS.set_event(STATUS, {"started_at": self._started_at, "progress": note})


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
