"""`rover-twin datasets delete`: what is still needed stays, as over HTTP."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from model_store import DatasetRecord, ModelStore
from service.cli.failures import RefusedError

_SQLITE = "sqlite:///"


def delete_unused(store: ModelStore, record: DatasetRecord, jobs_url: str, capacity: int) -> None:
    """Delete a dataset. Raises RefusedError while a version or a job that waits or runs names it."""
    versions = store.datasets_in_use().get(record.id, [])
    jobs = _jobs_naming(record.id, jobs_url, capacity)
    if versions or jobs:
        users = [*versions, *(f"training job {job}" for job in jobs)]
        raise RefusedError(f"dataset {record.name} ({record.id[:12]}) is kept: {', '.join(users)} needs it")
    store.delete_dataset(record.id)


def _jobs_naming(dataset: str, jobs_url: str, capacity: int) -> tuple[str, ...]:
    """The jobs that wait or run. A store that never had jobs is not given a database for them."""
    if jobs_url.startswith(_SQLITE) and not Path(jobs_url.removeprefix(_SQLITE)).is_file():
        return ()
    from service.jobs.queue import JobQueue

    with closing(JobQueue.open(jobs_url, capacity)) as queue:
        return queue.active_datasets().get(dataset, ())
