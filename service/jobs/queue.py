"""The queue of training jobs, as seen from outside a worker: submit, look, cancel, follow."""

from __future__ import annotations

import hashlib
import json
import math
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Self

from service import tracing
from service.errors import IdempotencyKeyError, JobNotFoundError, JobStateError, JobsUnavailableError
from service.jobs.database_file import patience_of
from service.jobs.job import ENDED, JobEvent, JobState, TrainingJob
from service.jobs.record import STATUSES, event_of, final_event, first_event, job_of, moment, submitted_ms
from service.jobs.request import TrainingJobRequest

if TYPE_CHECKING:
    from dbos import WorkflowStatus

    from model_store import ModelStore
    from service.jobs.database import JobsDatabase

# A key names its job by itself, in every replica and after every restart. Never change it.
_KEYS = uuid.UUID("6f1b9a52-7c0e-4d61-9a53-2f0c9be6a7d4")
_TIMEOUT_S = 4.5
_SAME_ANSWER_S = 1.0
_SCAN = 200  # rows per look while filtering, and how many looks: listing is bounded
_MOST_SCANS = 50
_MOST_EVENTS = 500


class JobQueue:
    """The jobs in one database. Safe to share between threads; every method blocks, for about 5 s at most.

    Every method may raise JobsUnavailableError. Nothing is opened before the first call, and a database that was
    down is tried again by the next one, so that a service can start without it.
    """

    def __init__(self, url: str, capacity: int, keep_days: int | None = None, timeout_s: float = _TIMEOUT_S) -> None:
        self._url = url
        self._patience_s = patience_of(timeout_s)
        self._keep_days = keep_days
        self._capacity = capacity
        self._lock = threading.Lock()
        self._opened: JobsDatabase | None = None
        self._failed = -math.inf, ""  # when opening failed last, and why

    @classmethod
    def open(cls, url: str, capacity: int, keep_days: int | None = None, timeout_s: float = _TIMEOUT_S) -> Self:
        """The queue in `url` (sqlite:///file or postgresql://...), in which `capacity` jobs may wait.

        `keep_days` is how long workers keep jobs that have ended; it is told to those who ask for one that is gone.
        A database that does not answer is given up a little before `timeout_s`.
        """
        return cls(url, capacity, keep_days, timeout_s)

    def prune(self, store: ModelStore, keep_days: int, *, dry_run: bool = False) -> int:
        """Remove the jobs that ended more than `keep_days` ago; how many (see `service.jobs.retention`)."""
        from service.jobs.retention import prune  # noqa: PLC0415 - brings dbos

        return prune(self._database, store, keep_days, dry_run=dry_run)

    def find(self, key: str, asked: TrainingJobRequest) -> TrainingJob | None:
        """The job that this very request, as it was before it was checked, has started with this key; None without.

        To be looked for before the request is checked: its datasets may have been deleted or renamed since.
        """
        row = self._database.row(_id_of(key))
        return self._complete(row) if row is not None and _is_of(row, asked) else None

    def require_fresh(self, key: str, published: Callable[[str], bool]) -> None:
        """Raises IdempotencyKeyError for the key of a job that made a version and was removed since.

        `published` says whether a job of this id made one: what one key has made must never be made again.
        """
        job_id = _id_of(key)
        if self._database.row(job_id) is None and published(job_id):
            raise IdempotencyKeyError(
                f"the idempotency key belongs to training job {job_id}, which made a version and was removed since; "
                "use a new key"
            )

    def submit(
        self,
        request: TrainingJobRequest,
        *,
        actor: str,
        key: str | None = None,
        asked: TrainingJobRequest | None = None,
    ) -> tuple[TrainingJob, bool]:
        """Queue a checked request; returns the job and whether it is new. On return it survives any kill.

        The same `key` with the same request gives the job that is there already. `asked` is the request before it was
        checked, `actor` is who asked.

        Raises:
            QueueFullError: `capacity` jobs wait already.
            IdempotencyKeyError: the key belongs to another request.
        """
        job_id = _id_of(key) if key is not None else str(uuid.uuid4())
        attributes = {
            "model": request.model,
            "submitted_ms": time.time_ns() // 1_000_000,
            "hand_backs": 0,
            "asked": _digest(asked or request),
        }
        if parent := tracing.traceparent():  # the worker goes on with this trace
            attributes["traceparent"] = parent
        content = request.model_dump(mode="json")
        new = self._database.enqueue(job_id, content, actor, attributes=attributes, capacity=self._capacity)
        row = self._row(job_id)
        job = self._complete(row)
        if not new and job.request != request and not _is_of(row, asked or request):
            raise IdempotencyKeyError(
                f"the idempotency key belongs to training job {job_id}, which has another request; use a new key"
            )
        return job, new

    def get(self, job_id: str) -> TrainingJob:
        """One job. Raises JobNotFoundError."""
        return self._complete(self._row(job_id))

    def list(
        self,
        *,
        state: JobState | None = None,
        model: str | None = None,
        limit: int = 50,
        before: str | None = None,
    ) -> list[TrainingJob]:
        """Jobs, newest first, those older than the job `before`; looks at the 10,000 next ones at most.

        Raises JobNotFoundError when there is no job `before`.
        """
        found: list[TrainingJob] = []
        for row in self._newest_first(state, self._row(before) if before is not None else None):
            if len(found) == limit:
                break
            if model is None or (row.attributes or {}).get("model") == model:
                found.append(self._complete(row))
        return found

    def cancel(self, job_id: str) -> TrainingJob:
        """Cancel a job that has not ended; a running one stops within seconds.

        What it wrote at that very moment, its version or the move of an alias, stays, whole.
        Raises JobNotFoundError, and JobStateError when it has ended.
        """
        job = self.get(job_id)
        if job.state not in ENDED:
            self._database.cancel(job_id)
            job = self.get(job_id)
            if job.state == "cancelled":
                return job
        raise JobStateError(f"training job {job_id} is {job.state}, allowed is to cancel queued and running ones")

    def events(self, job_id: str, after: int | None = None, wait_s: float = 0.0) -> tuple[JobEvent, ...]:
        """Events with a number above `after`, oldest first, 500 at most; waits up to `wait_s` for the next one.

        Empty when nothing came in that time, or when `after` is the job's last event, its final state.
        Raises JobNotFoundError.
        """
        row = self._row(job_id)
        found = [first_event(row)] if after is None or after < 0 else []
        # Event n is entry n - 1 of the stream: event 0 is that the job was queued. Reading begins with the event
        # `after` itself, which tells a job that ended after it from one whose last event it is.
        known = min(max(after or 0, 0), 1)
        start = max(after or 0, 0) - known
        entries, ended = self._database.entries(job_id, start, _MOST_EVENTS)
        nothing_new = len(entries) <= known and not (found or ended)
        if nothing_new and wait_s > 0 and self._database.wait_for_entry(job_id, start + known, wait_s):
            entries, ended = self._database.entries(job_id, start, _MOST_EVENTS)
        written = [event_of(number, entry) for number, entry in enumerate(entries, start + 1)]
        found += written[known:]
        if ended and len(entries) >= known:
            found.append(final_event(start + len(entries) + 1, self.get(job_id), written))
        return tuple(found)

    def active_datasets(self) -> dict[str, tuple[str, ...]]:
        """The ids of the jobs that wait or run, by the dataset that they name."""
        using: dict[str, tuple[str, ...]] = {}
        for row in self._database.rows([*STATUSES["queued"], *STATUSES["running"]], whole=True):
            for dataset in job_of(row).request.datasets:
                using[dataset] = (*using.get(dataset, ()), row.workflow_id)
        return using

    def counts(self) -> dict[JobState, int]:
        """How many jobs wait and how many run."""
        states: tuple[JobState, ...] = ("queued", "running")
        return {state: len(self._database.rows(STATUSES[state])) for state in states}

    def close(self) -> None:
        """Let go of the database; a later call would open it again."""
        with self._lock:
            if self._opened is not None:
                self._opened.close()
                self._opened = None

    @property
    def is_open(self) -> bool:
        """Whether the database has been opened: the first call takes seconds, and waits for no answer of later ones."""
        return self._opened is not None

    @property
    def _database(self) -> JobsDatabase:
        with self._lock:
            if self._opened is None:
                self._opened = self._open()
            return self._opened

    def _open(self) -> JobsDatabase:
        """Those who waited while opening failed are told the same at once, or each of them would wait in turn."""
        from service.jobs.database import JobsDatabase  # noqa: PLC0415 - two seconds, not for a service without jobs

        failed_at, reason = self._failed
        if time.monotonic() < failed_at + _SAME_ANSWER_S:
            raise JobsUnavailableError(reason)
        try:
            return JobsDatabase.open(self._url, patience_s=self._patience_s)
        except JobsUnavailableError as error:
            self._failed = time.monotonic(), str(error)
            raise

    def _row(self, job_id: str) -> WorkflowStatus:
        row = self._database.row(job_id)
        if row is None:
            kept = f"; jobs are kept for {self._keep_days} days after they end" if self._keep_days else ""
            raise JobNotFoundError(f"there is no training job {job_id[:100]!r}{kept}")
        return row

    def _complete(self, row: WorkflowStatus) -> TrainingJob:
        return job_of(row, self._database.note(row.workflow_id) if row.recovery_attempts else None)

    def _newest_first(self, state: JobState | None, last: WorkflowStatus | None) -> Iterator[WorkflowStatus]:
        """Rows older than `last`, at most 10,000."""
        # dbos compares whole milliseconds, cut off: one more keeps those of the same one in
        until = moment((last.created_at or 0) + 1).isoformat() if last else None
        statuses = STATUSES[state] if state else None
        for scan in range(_MOST_SCANS):
            rows = self._database.rows(statuses, limit=_SCAN, offset=scan * _SCAN, end_time=until, whole=True)
            for row in sorted(rows, key=_age, reverse=True):
                if last is None or _age(row) < _age(last):
                    yield row
            if len(rows) < _SCAN:
                return


def _id_of(key: str) -> str:
    return str(uuid.uuid5(_KEYS, key))


def _digest(request: TrainingJobRequest) -> str:
    return hashlib.sha256(json.dumps(request.model_dump(mode="json"), sort_keys=True).encode()).hexdigest()


def _is_of(row: WorkflowStatus, asked: TrainingJobRequest) -> bool:
    return (row.attributes or {}).get("asked") == _digest(asked)


def _age(row: WorkflowStatus) -> tuple[int, int, str]:
    """What jobs are sorted by: dbos's own time has whole seconds on SQLite."""
    return row.created_at or 0, submitted_ms(row), row.workflow_id
