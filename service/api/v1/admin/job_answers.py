"""The wire models of training jobs. A job itself is as `service.jobs.job` describes it; here it gets its addresses."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from urllib.parse import urlencode

from pydantic import BaseModel

from service.datasets.file_names import printable
from service.jobs.job import ENDED, JobEvent, TrainingJob

ADDRESS = "/v1/admin/training-jobs"

EXAMPLE = {
    "model": "viper-lunar",
    "datasets": ["paper", "mass"],
    "architecture": "drive_model",
    "split": {"test_slopes_deg": [28]},
    "promote": "if_better",
}


STREAM_EXAMPLE = """retry: 2000

id: 1
event: state
data: {"time":"2026-01-01T12:00:00+00:00","state":"running"}

id: 2
event: progress
data: {"time":"2026-01-01T12:00:01+00:00","phase":"fit","fraction":0.31,"epoch":12,"epochs":40,"eta_s":8.5}

"""


class JobLinks(BaseModel):
    """Where to go from here. `cancel` is null once the job has ended, `version` until it has made one."""

    self: str
    events: str
    logs: str
    cancel: str | None
    version: str | None


class JobAnswer(TrainingJob):
    """A training job: what was asked, by whom, where it stands, and what came out."""

    links: JobLinks


class JobsAnswer(BaseModel):
    """A page of jobs, newest first. `next` is the address of the page after it, null on the last one."""

    jobs: list[JobAnswer]
    next: str | None


class LogLine(BaseModel):
    """One line of a job's log; `number` is that of its event."""

    number: int
    time: datetime
    message: str


class JobLogAnswer(BaseModel):
    """A job's log, oldest line first. `next` is the address of what comes after, null when the log is complete."""

    lines: list[LogLine]
    next: str | None


def answer_of(job: TrainingJob) -> JobAnswer:
    """The job with its addresses."""
    here = f"{ADDRESS}/{job.id}"
    version = f"/v1/models/{job.result.model}/versions/{job.result.version}" if job.result else None
    links = JobLinks(
        self=here,
        events=f"{here}/events",
        logs=f"{here}/logs",
        cancel=None if job.state in ENDED else f"{here}/cancel",
        version=version,
    )
    return JobAnswer.model_validate({**dict(job), "links": links})


def page_of(jobs: Sequence[TrainingJob], limit: int, query: dict[str, str]) -> JobsAnswer:
    """The first `limit` of `jobs`; when there are more, `next` asks with `query` for those after them."""
    shown = jobs[:limit]
    more = len(jobs) > limit
    following = f"{ADDRESS}?{urlencode(query | {'limit': limit, 'before': shown[-1].id})}" if more else None
    return JobsAnswer(jobs=[answer_of(job) for job in shown], next=following)


def line_of(event: JobEvent) -> LogLine:
    """A log event as a line of the log."""
    return LogLine(number=event.number, time=event.time, message=str(event.data.get("message", "")))


def log_of(job_id: str, lines: list[LogLine], goes_on_after: int | None, limit: int) -> JobLogAnswer:
    """A page of a log; `goes_on_after` is the event after which the next page begins, None on the last one."""
    query = urlencode({"after": goes_on_after, "limit": limit})
    return JobLogAnswer(lines=lines, next=None if goes_on_after is None else f"{ADDRESS}/{job_id}/logs?{query}")


def text_of(lines: Sequence[LogLine]) -> str:
    """The lines as text: the time, a space and the message, each on one line."""
    return "".join(f"{line.time.isoformat(timespec='milliseconds')} {printable(line.message)}\n" for line in lines)


def is_last(event: JobEvent) -> bool:
    """Whether nothing comes after this event."""
    return event.kind == "state" and event.data.get("state") in ENDED
