"""A jobs database that is deleted, replaced, or has no room: nothing is acknowledged that will not be found again."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from service.errors import AuditUnavailableError, JobsDatabaseGoneError, JobsUnavailableError
from service.jobs.audit import Attempt, AuditLog
from service.jobs.queue import JobQueue
from service.jobs.request import TrainingJobRequest
from tests.jobs.nursery import Nursery, until

REQUEST = TrainingJobRequest(model="rover", datasets=["unit"])
ATTEMPT = Attempt("ada", "192.0.2.1", "PUT", "/v1/models/{name}", "/v1/models/viper", "r-1")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "jobs" / "jobs.sqlite"


@pytest.fixture
def queue(path):
    queue = JobQueue.open(f"sqlite:///{path}", 1000)
    yield queue
    queue.close()


def submit(queue):
    return queue.submit(REQUEST, actor="tests")[0].id


def rows_of(path):
    with closing(sqlite3.connect(path)) as connection:
        return {row[0] for row in connection.execute("SELECT workflow_uuid FROM workflow_status")}


def _delete(path: Path) -> None:
    path.unlink()


def _delete_all(path: Path) -> None:
    shutil.rmtree(path.parent)


def _delete_log(path: Path) -> None:
    path.with_name(path.name + "-wal").unlink()


def _replace(path: Path) -> None:
    path.with_name("other").write_bytes(b"")
    path.with_name("other").replace(path)


@pytest.mark.parametrize("spoil", [_delete, _delete_all, _delete_log, _replace])
def test_what_would_be_lost_is_not_acknowledged(queue, path, spoil):
    submit(queue)
    spoil(path)

    for _ in range(3):
        with pytest.raises(JobsUnavailableError):
            submit(queue)


@pytest.mark.parametrize("spoil", [_delete, _replace])
def test_neither_is_an_old_state_shown_nor_a_cancellation_taken(queue, path, spoil):
    job = submit(queue)
    spoil(path)

    for call in (queue.list, queue.counts, lambda: queue.get(job), lambda: queue.cancel(job)):
        with pytest.raises(JobsDatabaseGoneError):
            call()


def test_a_file_that_comes_back_is_the_same_database(queue, path):
    job = submit(queue)
    path.rename(path.with_name("away"))
    with pytest.raises(JobsUnavailableError):
        submit(queue)

    path.with_name("away").rename(path)

    assert {job, submit(queue)} <= {each.id for each in queue.list()}


def test_closing_the_old_file_leaves_the_log_of_the_new_one(queue, path):
    """SQLite would remove the log by its name, which both have."""
    submit(queue)
    shutil.move(path.parent, path.parent.with_name("away"))
    with closing(JobQueue.open(f"sqlite:///{path}", 1000)) as other:
        job = submit(other)

        queue.close()

        assert job in rows_of(path)
        assert submit(other) in rows_of(path)


@pytest.mark.parametrize("spoil", [_delete, _delete_all, _replace])
def test_the_audit_log_neither_acknowledges_nor_makes_the_file_anew(path, spoil):
    log = AuditLog(f"sqlite:///{path}", 365)
    number = log.begin(ATTEMPT)
    spoil(path)
    left = path.exists() and path.stat().st_size

    for call in (lambda: log.begin(ATTEMPT), lambda: log.complete(number, 200), lambda: log.page(limit=1)):
        with pytest.raises(AuditUnavailableError, match="deleted or replaced"):
            call()
    assert (path.exists() and path.stat().st_size) == left


@pytest.mark.parametrize("spoil", [_delete, _delete_all, _replace])
def test_an_admin_call_that_is_being_recorded_meanwhile_is_refused(path, spoil):
    """The file goes while the transaction runs: the row is in a file without a name."""
    log = AuditLog(f"sqlite:///{path}", 365)
    log.begin(ATTEMPT)

    def record_and_spoil():
        with log._connected() as connection:
            spoil(path)
            connection.exec_driver_sql("UPDATE rover_twin_audit SET status = 200")

    with pytest.raises(AuditUnavailableError):
        record_and_spoil()


def test_a_file_that_comes_back_has_the_same_audit_log(path):
    log = AuditLog(f"sqlite:///{path}", 365)
    first = log.begin(ATTEMPT)
    path.rename(path.with_name("away"))
    with pytest.raises(AuditUnavailableError):
        log.begin(ATTEMPT)

    path.with_name("away").rename(path)

    assert [row.id for row in AuditLog(f"sqlite:///{path}", 365).page(limit=5)] == [first]
    assert log.begin(ATTEMPT) > first


def test_a_log_that_others_make_anew_convinces_nobody(queue, path):
    """The audit log connects by name: SQLite then makes the deleted log anew, with nothing of what was in it."""
    audit = AuditLog(f"sqlite:///{path}", 365)
    audit.begin(ATTEMPT)
    submit(queue)
    _delete_log(path)

    for _ in range(3):
        with pytest.raises(AuditUnavailableError):
            audit.begin(ATTEMPT)
        with pytest.raises(JobsUnavailableError):
            submit(queue)


@pytest.mark.processes
def test_a_worker_ends_so_that_the_next_one_uses_the_new_file(store, path):
    with Nursery() as nursery:
        url = f"sqlite:///{path}"
        worker = nursery.start(Path(store.location), url)
        with closing(JobQueue.open(url, 10)) as queue:
            until(lambda: path.with_name("jobs.sqlite.workers").exists(), 60)
            queue.list()
        shutil.rmtree(path.parent)

        assert worker.wait(60) != 0


def test_a_full_disk_refuses_and_keeps_what_was_acknowledged(queue, path):
    """A bound on the size of files stands for the disk: the same error of a write, at the same place."""
    import resource
    import signal

    known = {submit(queue) for _ in range(3)}
    log = path.with_name(path.name + "-wal")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (log.stat().st_size + 1000, before[1]))
        for _ in range(3):
            with pytest.raises(JobsUnavailableError):
                submit(queue)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, ignored)

    new = submit(queue)

    assert {each.id for each in queue.list()} == known | {new}
