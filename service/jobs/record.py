"""From the rows that dbos keeps to a training job and its events."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from service.jobs.failure import failure_of, worker_lost
from service.jobs.job import JobEvent, JobFailure, JobProgress, JobResult, JobState, TrainingJob
from service.jobs.request import stored_request

if TYPE_CHECKING:
    from dbos import WorkflowStatus

STATUSES: dict[JobState, list[str]] = {
    "queued": ["ENQUEUED", "DELAYED"],
    "running": ["PENDING"],
    "succeeded": ["SUCCESS"],
    "failed": ["ERROR", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"],
    "cancelled": ["CANCELLED"],
}
_STATES: dict[str, JobState] = {status: state for state, statuses in STATUSES.items() for status in statuses}


def job_of(status: WorkflowStatus, note: dict[str, Any] | None = None) -> TrainingJob:
    """The job of a row, input and output loaded; `note` is what its worker last said of start and progress."""
    state = _STATES[status.status]
    note = note or {}
    request, actor = status.input["args"] if status.input else ({}, "")
    started = datetime.fromisoformat(note["started_at"]) if note.get("started_at") else None
    finished = moment(status.completed_at) if status.completed_at else None
    return TrainingJob(
        id=status.workflow_id,
        state=state,
        request=stored_request(request),
        actor=actor,
        created_at=moment(submitted_ms(status)),
        started_at=started,
        finished_at=max(finished, started) if finished and started else finished,  # whole seconds on SQLite
        attempts=status.recovery_attempts or 0,
        progress=JobProgress.model_validate(note["progress"]) if note.get("progress") else None,
        result=JobResult.model_validate(status.output) if state == "succeeded" else None,
        failure=_failure(status) if state == "failed" else None,
    )


def first_event(status: WorkflowStatus) -> JobEvent:
    """Event 0: the job was queued."""
    return JobEvent(number=0, kind="state", time=moment(submitted_ms(status)), data={"state": "queued"})


def event_of(number: int, entry: dict[str, Any]) -> JobEvent:
    """An event that the worker wrote."""
    return JobEvent(number=number, kind=entry["kind"], time=datetime.fromisoformat(entry["time"]), data=entry["data"])


def final_event(number: int, job: TrainingJob, earlier: Sequence[JobEvent]) -> JobEvent:
    """The last event: how the job ended; not before the `earlier` ones, though SQLite has whole seconds."""
    data: dict[str, Any] = {"state": job.state}
    for name in ("result", "failure"):
        value = getattr(job, name)
        if value is not None:
            data[name] = value.model_dump(mode="json")
    time = max([job.finished_at or job.created_at, *(event.time for event in earlier[-1:])])
    return JobEvent(number=number, kind="state", time=time, data=data)


def submitted_ms(status: WorkflowStatus) -> int:
    """When the job was submitted, milliseconds since 1970: as noted then, since on SQLite dbos keeps whole seconds."""
    noted = (status.attributes or {}).get("submitted_ms")
    return noted if isinstance(noted, int) else status.created_at or 0


def moment(milliseconds: int) -> datetime:
    """Milliseconds since 1970 as a time in UTC."""
    return datetime.fromtimestamp(milliseconds / 1000, UTC)


def _failure(status: WorkflowStatus) -> JobFailure:
    if status.status == "MAX_RECOVERY_ATTEMPTS_EXCEEDED":
        return worker_lost(status.recovery_attempts or 0)
    error = status.error or RuntimeError("the worker did not say why")
    return failure_of(error)
