"""How long jobs are kept that have ended, with their events, logs and keys. Versions know their own lineage.

A job that waits or runs is never touched. Workers do this once an hour, one of them at a time; two at once would do no
harm, since removing a job again removes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta

from model_store import ModelStore
from service.jobs.database import JobsDatabase
from service.jobs.lease import make_lease

BATCH = 100
MOST = 10_000  # in one go; the rest is for the next one

_LEASE = "removal of old jobs"


def prune(
    database: JobsDatabase, store: ModelStore, keep_days: int, *, now: datetime | None = None, dry_run: bool = False
) -> int:
    """Remove the jobs that ended more than `keep_days` ago, at most 10,000; how many these are.

    With `dry_run` they are only counted. Raises JobsUnavailableError and what the store raises; what was removed before
    stays removed.
    """
    until = (now or datetime.now(UTC)) - timedelta(days=keep_days)
    if dry_run:
        return len(database.ended_before(until, MOST))
    removed = 0
    while removed < MOST and (jobs := database.ended_before(until, BATCH)):
        for job in set(jobs).intersection(store.jobs_with_work()):
            store.remove_work(job)
        database.remove(jobs)
        removed += len(jobs)
    return removed


@contextmanager
def alone(database: JobsDatabase) -> Iterator[bool]:
    """Whether no other process removes old jobs now; while it is true, none begins to."""
    lease = make_lease(database.engine, _LEASE)
    held = lease.hold()
    try:
        yield held
    finally:
        if held:
            lease.release()
