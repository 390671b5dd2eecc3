"""Real workers on real databases, killed at any moment: the result is that of an undisturbed training, once."""

from __future__ import annotations

import hashlib
import random
import time
from itertools import pairwise

import psycopg
import pytest
import torch

from model_store import ModelNotFoundError, ModelStore
from service.jobs.job import ALLOWED_MOVES
from service.jobs.queue import JobQueue
from service.jobs.request import Budget, SplitRequest, TrainingJobRequest, check_request
from service.learning.checkpoint import weights_bytes
from tests.fair_clock import fair_clock
from tests.jobs.nursery import until
from tests.training.stored import put_dataset, stored_runs, train_model

KILLS = 4
DEADLY = 5
NETWORK = TrainingJobRequest(
    model="killed",
    datasets=("unit",),
    architecture="paper_network",
    budget=Budget(max_epochs=60),
    split=SplitRequest(test_slopes_deg=(5.0, 10.0)),
    promote="if_better",
)


# what has nothing to do with the database
on_one_engine = pytest.mark.parametrize("jobs_url", ["sqlite"], indirect=True)


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The sha256 of the weights of the same training, undisturbed and without jobs."""
    store = ModelStore.open(tmp_path_factory.mktemp("reference"), create=True)
    put_dataset(store, "unit", stored_runs())
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        trained = train_model(store, NETWORK.training_config())
    finally:
        torch.set_num_threads(threads)
    return hashlib.sha256(weights_bytes(trained.model)).hexdigest()


@pytest.fixture
def clock():
    with fair_clock() as clock:
        yield clock


@pytest.fixture
def place(tmp_path):
    return tmp_path / "store"


@pytest.fixture
def jobs(jobs_url):
    queue = JobQueue.open(jobs_url, 16)
    yield queue
    queue.close()


@pytest.fixture
def start(nursery, place, jobs_url):
    yield lambda **how: nursery.start(place, jobs_url, **how)
    nursery.end_all()


def submit(store, jobs, request=NETWORK, **changes):
    checked = check_request(store, request.model_copy(update=changes))
    return jobs.submit(checked, actor="tester")[0].id


def ended(jobs, job_id, timeout_s=150):
    job = until(lambda: (job := jobs.get(job_id)) and job.finished_at and job, timeout_s, f"job {job_id} ended")
    assert job.failure is None, job.failure
    return job


def progress_of(jobs, job_id):
    return [event.data for event in jobs.events(job_id) if event.kind == "progress"]


def weights_of(store, job):
    return store.manifest(job.result.model, job.result.version).files["weights.safetensors"].sha256


def require_in_order(jobs, job_id):
    """Numbers without gaps, only allowed moves, time that does not run back; the states it went through."""
    events = jobs.events(job_id)
    assert [event.number for event in events] == list(range(len(events)))
    states = [event.data["state"] for event in events if event.kind == "state"]
    for one, other in pairwise(states):
        # a worker that was killed says nothing: the next one's "running" follows its own
        assert other in ALLOWED_MOVES[one] or (one, other) == ("running", "running")
    assert all(one.time <= other.time for one, other in pairwise(events))
    return states


def test_a_job_makes_what_a_training_makes(store, jobs, start, expected):
    job_id = submit(store, jobs)
    worker = start(once=True)
    job = ended(jobs, job_id)
    assert worker.wait() == 0
    assert (job.state, job.attempts, job.result.version) == ("succeeded", 1, 1)
    assert weights_of(store, job) == expected
    assert require_in_order(jobs, job_id) == ["queued", "running", "succeeded"]
    fractions = [data["fraction"] for data in progress_of(jobs, job_id)]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1
    assert job.created_at <= job.started_at <= job.finished_at
    manifest = store.verify("killed", 1)
    assert manifest.lineage.job == job_id
    assert manifest.created_by == "tester"
    assert [move["alias"] for move in job.result.moves] == ["candidate", "champion"]
    assert store.resolve("killed@champion").version == 1
    assert store.work_names(job_id) == []


@pytest.mark.kills
def test_killed_again_and_again_a_job_ends_with_the_very_same_weights(store, jobs, start, expected):
    job_id = submit(store, jobs)
    delays = random.Random(4)
    for _ in range(KILLS):
        worker = start()
        until(lambda: jobs.get(job_id).state != "queued", what="taken up")
        time.sleep(delays.uniform(0.0, 0.8))
        worker.kill()
    start()
    job = ended(jobs, job_id)
    assert weights_of(store, job) == expected
    assert store.versions("killed") == [job.result.version]
    assert len(store.alias_history("killed", "candidate")) == 1
    assert len(store.alias_history("killed", "champion")) == 1
    assert store.work_names(job_id) == []
    require_in_order(jobs, job_id)


@pytest.mark.kills
def test_the_other_worker_goes_on_when_one_is_killed(store, jobs, start, expected, clock):
    first = start()
    job_id = submit(store, jobs)
    until(lambda: any(data["epoch"] for data in progress_of(jobs, job_id)), what="an epoch")
    start()
    first.kill()
    clock.wait_until(lambda: jobs.get(job_id).attempts == 2, 5, "taken over")
    job = ended(jobs, job_id)
    assert weights_of(store, job) == expected
    assert store.versions("killed") == [1]


def test_two_workers_share_the_queue(store, jobs, start):
    ids = [submit(store, jobs, model=f"shared-{number}", budget=Budget(max_epochs=20)) for number in range(3)]
    start()
    start()
    until(lambda: jobs.counts()["running"] == 2, what="two at once")
    assert all(ended(jobs, job_id).attempts == 1 for job_id in ids)
    assert all(store.versions(f"shared-{number}") == [1] for number in range(3))


def test_told_to_end_a_worker_hands_its_job_back(store, jobs, start, expected, clock):
    worker = start()
    job_id = submit(store, jobs)
    until(lambda: any(data["epoch"] for data in progress_of(jobs, job_id)), what="an epoch")
    asked_at = clock()
    worker.terminate()
    assert worker.wait() == 0
    assert clock() - asked_at < 5
    assert jobs.get(job_id).state == "queued"
    start()
    assert weights_of(store, ended(jobs, job_id)) == expected
    assert store.versions("killed") == [1]


@pytest.mark.parametrize("architecture", ["paper_network", "drive_model"])
def test_a_cancelled_job_stops_within_seconds_and_leaves_nothing(store, jobs, start, clock, architecture):
    start()
    job_id = submit(store, jobs, architecture=architecture, budget=Budget(max_epochs=10_000))
    until(lambda: progress_of(jobs, job_id), what="some progress")
    cancelled = jobs.cancel(job_id)
    after = submit(store, jobs, model="after", architecture="zero")
    clock.wait_until(lambda: jobs.get(after).state != "queued", 3, "the next job runs")
    assert ended(jobs, after).state == "succeeded"
    assert cancelled.state == jobs.get(job_id).state == "cancelled"
    assert require_in_order(jobs, job_id) == ["queued", "running", "cancelled"]
    with pytest.raises(ModelNotFoundError):
        store.versions("killed")
    until(lambda: store.work_names(job_id) == [], 30, "no work files")


@pytest.mark.kills
@on_one_engine
def test_a_job_that_gets_further_each_time_survives_any_number_of_kills(store, jobs, start):
    job_id = submit(store, jobs, budget=Budget(max_epochs=600))
    for _ in range(DEADLY + 1):
        before = store.work_names(job_id)
        worker = start()
        until(lambda before=before: set(store.work_names(job_id)) - set(before), what="a piece of the fit")
        time.sleep(0.3)  # it is recorded
        worker.kill()
    start()
    job = ended(jobs, job_id)
    assert (job.state, job.attempts) == ("succeeded", DEADLY + 2)
    assert store.versions("killed") == [1]


@pytest.mark.kills
@on_one_engine
def test_a_job_that_kills_its_workers_fails_in_the_end(store, jobs, start):
    job_id = submit(store, jobs)
    for _ in range(DEADLY):
        start(deadly=True).wait()
    start()
    job = until(lambda: (job := jobs.get(job_id)) and job.finished_at and job)
    assert (job.state, job.failure.type) == ("failed", "WorkerLost")
    assert f"{DEADLY} workers were killed" in job.failure.message
    assert job.failure.remedy
    with pytest.raises(ModelNotFoundError):
        store.versions("killed")


@on_one_engine
def test_a_job_whose_dataset_is_deleted_while_it_is_submitted_says_so(store, jobs, start):
    checked = check_request(store, NETWORK)
    store.delete_dataset(checked.datasets[0])  # nobody names it yet, so nothing holds this up
    job_id = jobs.submit(checked, actor="tester")[0].id
    start(once=True)
    job = until(lambda: (job := jobs.get(job_id)) and job.finished_at and job)
    assert (job.state, job.failure.type) == ("failed", "DatasetNotFoundError")
    assert checked.datasets[0] in job.failure.message
    assert job.failure.remedy
    assert require_in_order(jobs, job_id) == ["queued", "running", "failed"]
    with pytest.raises(ModelNotFoundError):
        store.versions("killed")
    assert store.work_names(job_id) == []


@on_one_engine
def test_time_that_is_up_ends_the_fit_with_the_best_epoch(store, jobs, start):
    start(once=True)
    job_id = submit(store, jobs, budget=Budget(max_epochs=10_000, max_minutes=0.005))
    job = ended(jobs, job_id)
    fit = store.manifest("killed", job.result.version).metrics["fit"]
    assert 0 < fit["epochs"] < 10_000
    assert fit["stopped_early"]
    assert 0.3 <= fit["elapsed_s"] < 60  # of the minutes that so many epochs would take


@pytest.mark.kills
def test_a_database_server_that_is_killed_only_delays(store, postgres, nursery, place, expected):
    url = postgres.new_database()
    jobs = JobQueue.open(url, 16)
    job_id = submit(store, jobs)
    worker = nursery.start(place, url)
    try:
        until(lambda: any(data["epoch"] for data in progress_of(jobs, job_id)), what="an epoch")
        postgres.kill()
        time.sleep(0.5)
        postgres.start()
        job = ended(jobs, job_id)
        assert weights_of(store, job) == expected
        assert store.versions("killed") == [1]
        assert worker.code is None
    finally:
        jobs.close()
        nursery.end_all()


def test_an_error_of_the_database_is_no_failure_of_the_job(store, postgres, nursery, place, expected):
    url = postgres.new_database()
    jobs = JobQueue.open(url, 16)
    job_id = submit(store, jobs)
    try:
        with psycopg.connect(url, autocommit=True) as database:
            database.execute("ALTER TABLE dbos.streams RENAME TO elsewhere")
            nursery.start(place, url)
            until(lambda: jobs.get(job_id).attempts >= 2, what="tried again")
            database.execute("ALTER TABLE dbos.elsewhere RENAME TO streams")
        job = ended(jobs, job_id)
        assert weights_of(store, job) == expected
        assert store.versions("killed") == [1]
    finally:
        jobs.close()
        nursery.end_all()
