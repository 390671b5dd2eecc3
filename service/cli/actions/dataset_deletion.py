"""`rover-twin datasets delete`: what is still needed stays, as over HTTP."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from model_store import DatasetRecord, ModelStore
from service.jobs import dataset_users
from service.jobs.queue import JobQueue

_SQLITE = "sqlite:///"


def delete_unused(store: ModelStore, record: DatasetRecord, jobs_url: str, capacity: int) -> None:
    """Delete a dataset. Raises DatasetInUseError. A store that never had jobs is not given a database for them."""
    if jobs_url.startswith(_SQLITE) and not Path(jobs_url.removeprefix(_SQLITE)).is_file():
        dataset_users.delete_unused(store, None, record.id)
        return
    with closing(JobQueue.open(jobs_url, capacity)) as queue:
        dataset_users.delete_unused(store, queue, record.id)
