"""Who needs a dataset, and deleting one that nobody needs."""

from __future__ import annotations

from model_store import ModelStore
from service.errors import DatasetInUseError
from service.jobs.queue import JobQueue


def jobs_of(queue: JobQueue | None, dataset: str) -> list[str]:
    """The ids of the jobs that wait or run and name the dataset of this id; none where there is no queue."""
    return [] if queue is None else list(queue.active_datasets().get(dataset, ()))


def delete_unused(store: ModelStore, queue: JobQueue | None, dataset: str) -> None:
    """Delete the dataset of this id, also a damaged one or what a killed deletion left.

    Raises DatasetInUseError while a version or a job names it, and what store and queue raise.
    """
    versions, jobs = store.datasets_in_use().get(dataset, []), jobs_of(queue, dataset)
    if versions or jobs:
        raise DatasetInUseError(dataset, versions, jobs)
    store.delete_dataset(dataset)
