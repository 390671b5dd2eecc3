"""From the options of `rover-twin jobs start` to a job in the queue."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from model_store import ModelStore
from service.jobs.job import TrainingJob
from service.jobs.queue import JobQueue
from service.jobs.request import TrainingJobRequest, check_request


def request_of(given: Mapping[str, Any]) -> TrainingJobRequest:
    """The request in which options that are None, at any depth, have their defaults. Raises ValidationError."""
    return TrainingJobRequest.model_validate(_without_none(given))


def submit(
    store: ModelStore, queue: JobQueue, request: TrainingJobRequest, *, actor: str, key: str | None
) -> tuple[TrainingJob, bool]:
    """Check and queue. The job, and whether it is new; raises what `check_request` and `JobQueue.submit` raise.

    What was queued with this key before is not checked again.
    """
    known = queue.find(key, request) if key is not None else None
    if known is not None:
        return known, False
    return queue.submit(check_request(store, request), actor=actor, key=key, asked=request)


def _without_none(given: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: _without_none(value) if isinstance(value, Mapping) else value
        for name, value in given.items()
        if value is not None
    }
