"""How `rover-twin jobs` lays out what the queue says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Any

from rich.table import Table

from service.cli.output import make_table
from service.cli.views.job_progress import epochs_of, errors_of, time_left_of
from service.jobs.job import ENDED, TrainingJob
from service.jobs.queue import JobQueue


def jobs_table(jobs: Sequence[TrainingJob]) -> Table:
    """One line per job."""
    table = make_table("id", "state", "model", "made", "queued at", "by", left=6)
    for job in jobs:
        made = f"{job.result.model}@{job.result.version}" if job.result else _progress(job)
        table.add_row(job.id, job.state, job.request.model, made or "-", _when(job.created_at), job.actor)
    return table


def job_facts(job: TrainingJob) -> Table:
    """Everything a person asks of one job; `--json` has all of it."""
    asked, result, failure = job.request, job.result, job.failure
    facts = {
        "state": job.state,
        "model": asked.model,
        "datasets": ", ".join(each[:12] for each in asked.datasets),
        "architecture": f"{asked.architecture} on {asked.prior}",
        "kept for testing": _kept(job),
        "seed": asked.seed,
        "budget": f"{asked.budget.max_epochs} epochs, {asked.budget.max_minutes:g} minutes",
        "promote": "never" if asked.promote == "never" else f"if better by {100 * asked.margin:g} %",
        "description": asked.description,
        "queued": f"{_when(job.created_at)} by {job.actor}",
        "started": _when(job.started_at),
        "ended": _when(job.finished_at),
        "attempts": job.attempts,
        "progress": _progress(job),
        "version": f"{result.model}@{result.version}" if result else None,
        "same weights as": result.same_weights_as if result else None,
        "aliases moved": ", ".join(str(move.get("alias")) for move in result.moves) if result else None,
        "beside the champion": _comparison(job),
        "failure": f"{failure.type}: {failure.message}" if failure else None,
        "what to do": failure.remedy if failure else None,
    }
    table = make_table("id", job.id, left=2)
    for what, value in facts.items():
        if value not in (None, ""):
            table.add_row(what, str(value))
    return table


def log_lines(queue: JobQueue, job_id: str) -> Iterator[dict[str, Any]]:
    """The job's log as {number, time, message}, oldest first. Raises what `JobQueue.events` raises."""
    after: int | None = None
    while events := queue.events(job_id, after=after):
        for event in events:
            if event.kind == "log":
                yield {
                    "number": event.number,
                    "time": event.time.isoformat(timespec="milliseconds"),
                    "message": str(event.data["message"]),
                }
        after = events[-1].number


def _progress(job: TrainingJob) -> str:
    if job.progress is None or job.state in ENDED:
        return ""
    reached = job.progress.model_dump()
    parts = (f"{100 * job.progress.fraction:.0f} %", job.progress.phase, epochs_of(reached))
    return ", ".join(filter(None, (*parts, errors_of(reached), time_left_of(reached))))


def _kept(job: TrainingJob) -> str:
    split = job.request.split
    slopes = ", ".join(f"{slope:g}" for slope in split.test_slopes_deg)
    parts = (f"runs at {slopes} deg" if slopes else "", f"{100 * split.test_fraction:g} % at random")
    return " and ".join(part for part in parts if part and not part.startswith("0 %")) or "none"


def _comparison(job: TrainingJob) -> str | None:
    comparison = job.result.comparison if job.result else None
    sentence = comparison.get("sentence") or comparison.get("reason") if comparison else None
    return str(sentence) if sentence else None


def _when(time: datetime | None) -> str:
    return time.isoformat(timespec="seconds") if time else ""
