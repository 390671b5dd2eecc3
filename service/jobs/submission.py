"""Starting a training job, whoever asks for it."""

from __future__ import annotations

from model_store import ModelStore
from service.jobs.job import TrainingJob
from service.jobs.queue import JobQueue
from service.jobs.request import TrainingJobRequest, check_request


def submit(
    store: ModelStore, queue: JobQueue, request: TrainingJobRequest, *, actor: str, key: str | None
) -> tuple[TrainingJob, bool]:
    """Check a request and queue it; the job, and whether it is new. Blocks while store and queue are asked.

    What the same `key` has started before is not checked again: its datasets may be gone since. Raises what
    `check_request` and `JobQueue.submit` raise.
    """
    known = queue.find(key, request) if key is not None else None
    if known is not None:
        return known, False
    if key is not None:
        queue.require_fresh(key, lambda job: store.published_once(request.model, job) is not None)
    return queue.submit(check_request(store, request), actor=actor, key=key, asked=request)
