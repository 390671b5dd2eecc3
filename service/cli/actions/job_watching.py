"""Following a training job from the command line until it ends."""

from __future__ import annotations

from service.cli.failures import RefusedError
from service.cli.output import note
from service.cli.views.job_progress import JobProgressView, make_view
from service.errors import TrainingError
from service.jobs.job import ENDED, JobEvent, TrainingJob
from service.jobs.queue import JobQueue

_WAIT_S = 1.0  # also how long Ctrl-C may take


def watch(queue: JobQueue, job_id: str) -> TrainingJob:
    """Show every event of the job on stderr until its last one; returns the job as it ended.

    Raises what `JobQueue.events` raises. An interruption leaves the job alone and says how to watch it again.
    """
    after: int | None = None
    try:
        with make_view() as view:
            while True:
                events = queue.events(job_id, after=after, wait_s=_WAIT_S)
                for event in events:
                    _show(view, event)
                    after = event.number
                if events and events[-1].kind == "state" and events[-1].data["state"] in ENDED:
                    return queue.get(job_id)
    except KeyboardInterrupt:
        note(f"the job goes on; rover-twin jobs watch {job_id} follows it again")
        raise


def raise_unless_succeeded(job: TrainingJob) -> None:
    """Raises TrainingError for a job that failed, RefusedError for one that was cancelled."""
    if job.failure is not None:
        raise TrainingError(f"training job {job.id} failed: {job.failure.message} {job.failure.remedy}")
    if job.state == "cancelled":
        raise RefusedError(f"training job {job.id} was cancelled")


def _show(view: JobProgressView, event: JobEvent) -> None:
    if event.kind == "progress":
        view.progress(event.data)
    elif event.kind == "log":
        view.log(str(event.data["message"]))
    else:
        view.state(str(event.data["state"]))
