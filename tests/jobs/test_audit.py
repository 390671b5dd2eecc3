"""The audit log: a row before the call, its status after it, bounded pages, and several processes at once."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

import pytest
import sqlalchemy as sa

from service.errors import AuditUnavailableError
from service.jobs.audit import TABLE, Attempt, AuditLog
from service.jobs.queue import JobQueue


def attempt(actor="ada", **changes):
    said = {
        "client": "192.0.2.1",
        "method": "PUT",
        "route": "/v1/models/{name}/aliases/{alias}",
        "path": "/v1/models/viper/aliases/champion",
        "request_id": "r-1",
    }
    return Attempt(actor=actor, **(said | changes))


@pytest.fixture
def log(jobs_url):
    return AuditLog(jobs_url, 365)


def test_a_row_is_there_before_the_status_is_known(log):
    before = datetime.now(UTC)
    number = log.begin(attempt())
    (row,) = log.page(limit=10)

    assert (row.id, row.actor, row.client, row.status) == (number, "ada", "192.0.2.1", None)
    assert (row.method, row.route, row.path, row.request_id) == attempt()[2:]
    assert before - timedelta(seconds=1) <= row.at <= datetime.now(UTC) + timedelta(seconds=1)
    log.complete(number, 201)
    assert [each.status for each in log.page(limit=10)] == [201]


def test_what_a_call_was_about_is_kept_and_bounded(log):
    number, silent = log.begin(attempt()), log.begin(attempt())
    log.complete(number, 200, "x" * 5000)
    log.complete(silent, 404)

    assert [each.subject for each in log.page(limit=10)] == [None, "x" * 300]


def test_a_table_that_was_dropped_is_made_again(log, jobs_url):
    log.begin(attempt())
    log.complete(1, 200)
    engine = sa.create_engine(jobs_url.replace("postgresql://", "postgresql+psycopg://"))

    for call in (lambda: log.begin(attempt()), lambda: log.page(limit=1), lambda: log.complete(1, 200), log.forget):
        with engine.begin() as connection:
            connection.execute(sa.text(f"DROP TABLE {TABLE}"))
        call()
    log.complete(log.begin(attempt()), 200)
    engine.dispose()
    assert [each.status for each in log.page(limit=10)] == [200]


def test_a_table_from_before_there_were_subjects_gets_them(log, jobs_url):
    number = log.begin(attempt())
    engine = sa.create_engine(jobs_url.replace("postgresql://", "postgresql+psycopg://"))
    with engine.begin() as connection:
        connection.execute(sa.text(f"ALTER TABLE {TABLE} DROP COLUMN subject"))
    engine.dispose()

    newer = AuditLog(jobs_url, 365)
    newer.complete(number, 200, "viper@1")
    assert [(each.id, each.subject) for each in newer.page(limit=10)] == [(number, "viper@1")]


@pytest.mark.parametrize("timeout_s", [0.5, 1.5])
def test_a_locked_table_is_given_up_within_the_time(jobs_url, timeout_s):
    log = AuditLog(jobs_url, 365, timeout_s)
    log.begin(attempt())
    engine = sa.create_engine(jobs_url.replace("postgresql://", "postgresql+psycopg://"))
    lock = f"LOCK TABLE {TABLE}" if engine.dialect.name == "postgresql" else "BEGIN IMMEDIATE"
    with engine.connect() as connection:
        connection.exec_driver_sql(lock)
        began = time.monotonic()
        with pytest.raises(AuditUnavailableError):
            log.begin(attempt())
        assert time.monotonic() - began < timeout_s + 0.5  # and what a busy machine adds
    engine.dispose()


def test_another_log_on_the_same_database_sees_the_same(log, jobs_url):
    number = log.begin(attempt())
    other = AuditLog(jobs_url, 365)
    other.complete(number, 200)
    second = other.begin(attempt("joe"))

    assert [(each.id, each.status) for each in log.page(limit=10)] == [(second, None), (number, 200)]


def test_pages_are_newest_first_and_together_all_there_is(log):
    made = [log.begin(attempt("ada" if number % 3 else "joe")) for number in range(10)]

    def pages(**wanted):
        before = None
        while page := log.page(limit=3, before=before, **wanted):
            assert len(page) <= 3
            yield from page
            before = page[-1].id

    assert [each.id for each in pages()] == made[::-1]
    assert [each.id for each in pages(actor="joe")] == [made[9], made[6], made[3], made[0]]
    assert list(pages(actor="nobody")) == []


def test_times_select_from_the_first_to_before_the_last(log):
    log.begin(attempt())
    (row,) = log.page(limit=1)

    assert log.page(limit=5, since=row.at) == [row]
    assert log.page(limit=5, since=row.at + timedelta(milliseconds=1)) == []
    assert log.page(limit=5, until=row.at) == []
    assert log.page(limit=5, until=row.at + timedelta(milliseconds=1)) == [row]
    assert log.page(limit=5, since=row.at.replace(tzinfo=None)) == [row]


def test_many_who_begin_at_once_in_a_new_database_all_get_a_row(jobs_url):
    logs = [AuditLog(jobs_url, 365) for _ in range(4)]

    with ThreadPoolExecutor(8) as pool:
        numbers = list(pool.map(lambda number: logs[number % 4].begin(attempt()), range(24)))

    assert len(set(numbers)) == 24
    assert sorted(each.id for each in logs[0].page(limit=100)) == sorted(numbers)


def test_texts_come_back_as_they_were(log):
    nasty = "'; DROP TABLE rover_twin_audit; -- %s {x} \u00e4\u2603"
    log.begin(attempt(nasty, path="/" + "x" * 5000))

    (row,) = log.page(limit=1, actor=nasty)
    assert row.actor == nasty
    assert len(row.path) == 1000


def test_rows_are_forgotten_after_their_days(log, jobs_url):
    old, new = log.begin(attempt()), log.begin(attempt())
    engine = sa.create_engine(jobs_url.replace("postgresql://", "postgresql+psycopg://"))
    with engine.begin() as connection:
        connection.execute(sa.text(f"UPDATE {TABLE} SET at_ms = at_ms - {366 * 86_400_000} WHERE id = {old}"))
    engine.dispose()

    assert log.forget() == 1
    assert [each.id for each in log.page(limit=10)] == [new]
    assert AuditLog(jobs_url, 1).forget() == 0
    # a new process does it by itself
    assert log.begin(attempt()) > new


def test_the_queue_and_the_log_share_a_database(log, jobs_url):
    first = log.begin(attempt())
    queue = JobQueue.open(jobs_url, 4)
    try:
        assert queue.list() == []
        log.complete(first, 202)
        assert queue.counts() == {"queued": 0, "running": 0}
    finally:
        queue.close()


@pytest.mark.parametrize(
    "url",
    ["sqlite:////proc/nowhere/jobs.sqlite", "postgresql://ada:secret-word@127.0.0.1:9/jobs"],
    ids=["sqlite", "postgresql"],
)
def test_what_cannot_be_written_is_an_error_without_secrets(url):
    log = AuditLog(url, 365)
    for call in (lambda: log.begin(attempt()), lambda: log.complete(1, 200), lambda: log.page(limit=1)):
        with pytest.raises(AuditUnavailableError) as caught:
            call()
        assert "secret-word" not in str(caught.value)
