"""Jobs that ended long ago go with everything that the database has of them; all others, and all versions, stay."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta

import pytest
import sqlalchemy as sa

from service.errors import IdempotencyKeyError, JobNotFoundError
from service.jobs import retention
from service.jobs.database import JobsDatabase
from service.jobs.queue import JobQueue
from service.jobs.request import Budget, TrainingJobRequest
from service.jobs.submission import submit
from tests.cli.conftest import call
from tests.jobs.nursery import until

REQUEST = TrainingJobRequest(model="kept", datasets=("unit",), architecture="zero", budget=Budget(max_epochs=1))


@pytest.fixture
def jobs(jobs_url):
    queue = JobQueue.open(jobs_url, 500, keep_days=30)
    yield queue
    queue.close()


@pytest.fixture
def database(jobs_url):
    database = JobsDatabase.open(jobs_url, patience_s=5)
    yield database
    database.close()


def tables_of(engine):
    """Every table of dbos that has rows of jobs, as the database describes it."""
    described = sa.MetaData()
    described.reflect(engine, schema=None if engine.dialect.name == "sqlite" else "dbos")
    found = {table.name: table for table in described.tables.values() if "workflow_uuid" in table.c}
    assert len(found) > 5
    return found


def age(database, job, days):
    """Let the job have ended so many days ago."""
    ended = int((datetime.now(UTC) - timedelta(days=days)).timestamp() * 1000)
    table = tables_of(database.engine)["workflow_status"]
    with database.engine.begin() as connection:
        change = sa.update(table).where(table.c.workflow_uuid == job)
        connection.execute(change.values(completed_at=ended, created_at=ended))


def rows_of(database, job):
    """How many rows each table has of the job, where there are any."""
    counts = {}
    with database.engine.connect() as connection:
        for table in tables_of(database.engine).values():
            chosen = sa.select(sa.func.count()).select_from(table).where(table.c.workflow_uuid == job)
            if count := connection.scalar(chosen):
                counts[table.name] = count
    return counts


def test_only_jobs_that_ended_before_that_time_go(jobs, database, store):
    ended = {days: jobs.submit(REQUEST, actor="tester")[0].id for days in (0, 29, 31, 400)}
    for days, job in ended.items():
        jobs.cancel(job)
        age(database, job, days)
    waiting = jobs.submit(REQUEST, actor="tester")[0].id
    age(database, waiting, 400)  # it has waited for long, and may run any time

    assert jobs.prune(store, 30, dry_run=True) == 2
    assert len(jobs.list()) == 5
    assert jobs.prune(store, 30) == 2
    assert {job.id for job in jobs.list()} == {ended[0], ended[29], waiting}
    assert jobs.prune(store, 30) == 0
    for days in (31, 400):
        assert rows_of(database, ended[days]) == {}
        for ask in (jobs.get, jobs.events, jobs.cancel):
            with pytest.raises(JobNotFoundError, match="kept for 30 days after they end"):
                ask(ended[days])


def test_many_go_in_batches_and_no_more_than_may(jobs, database, store, monkeypatch):
    monkeypatch.setattr(retention, "BATCH", 3)
    monkeypatch.setattr(retention, "MOST", 6)
    for number in range(8):
        job = jobs.submit(REQUEST, actor="tester", key=str(number))[0].id
        jobs.cancel(job)
        age(database, job, 10)
    assert [jobs.prune(store, 5) for _ in range(3)] == [6, 2, 0]
    assert jobs.submit(REQUEST, actor="tester", key="0")[1], "a key goes with its job"


def test_one_process_at_a_time_removes(database, jobs_url):
    with retention.alone(database) as first:
        other = JobsDatabase.open(jobs_url, patience_s=5)
        with retention.alone(other) as second:
            assert (first, second) == (True, False)
        other.close()

    def alone_again():  # a server ends a session a moment after it was left
        with retention.alone(database) as mine:
            return mine

    until(alone_again, 20)


def test_the_command_removes_and_says_how_many(jobs, database, store, jobs_url):
    job = jobs.submit(REQUEST, actor="tester")[0].id
    jobs.cancel(job)
    age(database, job, 100)
    options = ("--store", store.location, "--database", jobs_url, "--json")
    told = [call("jobs", "prune", *more, *options).json for more in (("--dry-run",), ("--older-than-days", "101"), ())]
    assert [(each["jobs"], each["older_than_days"]) for each in told] == [(1, 90), (0, 101), (1, 90)]
    assert call("jobs", "prune", "--older-than-days", "0", *options).code == 2


@pytest.mark.processes
def test_a_real_job_goes_whole_and_its_version_stays(jobs, database, store, nursery, jobs_url, tmp_path):
    """And two jobs that make the same weights say so."""
    made = [submit(store, jobs, REQUEST, actor="tester", key=key)[0].id for key in ("one", "two")]
    worker = nursery.start(tmp_path / "store", jobs_url, once=True)
    assert worker.wait(120) == 0
    first, second = (until(lambda job=job: (found := jobs.get(job)).result and found) for job in made)
    assert (first.result.version, second.result.version) == (1, 2)
    assert (first.result.same_weights_as, second.result.same_weights_as) == (None, "kept@1")
    manifests = [store.manifest("kept", version) for version in (1, 2)]
    assert [each.lineage.same_weights_as for each in manifests] == [None, "kept@1"]
    assert any("weights are those of kept@1" in str(event.data) for event in jobs.events(made[1]))

    age(database, made[0], 31)
    assert len(rows_of(database, made[0])) > 3
    assert jobs.prune(store, 30) == 1
    assert rows_of(database, made[0]) == {}
    assert store.verify("kept", 1) == manifests[0]
    assert manifests[0].lineage.job == made[0]
    assert json.loads(manifests[0].model_dump_json())["lineage"]["seed"] == REQUEST.seed
    with pytest.raises(IdempotencyKeyError, match="which made a version"):
        submit(store, jobs, REQUEST, actor="tester", key="one")
    assert submit(store, jobs, REQUEST, actor="tester", key="two")[0].id == made[1]
