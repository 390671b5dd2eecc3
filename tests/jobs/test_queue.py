"""The queue from outside, on both engines, without a worker."""

from __future__ import annotations

import random
import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest
from pydantic import ValidationError

from model_store import DatasetNotFoundError
from service.errors import (
    IdempotencyKeyError,
    InvalidValueError,
    JobNotFoundError,
    JobStateError,
    JobsUnavailableError,
    QueueFullError,
)
from service.jobs.queue import JobQueue
from service.jobs.request import Budget, SplitRequest, TrainingJobRequest, check_request, stored_request
from tests.fair_clock import fair_clock
from tests.training.stored import put_dataset, stored_runs, varying_runs

REQUEST = TrainingJobRequest(model="my-rover", datasets=("a" * 64,))


@pytest.fixture
def jobs(jobs_url):
    queue = JobQueue.open(jobs_url, 8)
    yield queue
    queue.close()


@pytest.fixture
def clock():
    with fair_clock() as clock:
        yield clock


def another(number=0, **changes):
    return REQUEST.model_copy(update={"seed": number, **changes})


@pytest.mark.processes
def test_what_was_submitted_is_there_for_others_and_after_a_restart(jobs, jobs_url):
    job, new = jobs.submit(REQUEST, actor="tester")
    assert new
    assert (job.state, job.request, job.actor, job.attempts) == ("queued", REQUEST, "tester", 0)
    assert job.progress is job.result is job.failure is job.started_at is job.finished_at is None
    other = JobQueue.open(jobs_url, 8)
    assert other.get(job.id) == jobs.get(job.id) == job
    other.close()


def test_one_key_is_one_job(jobs):
    first, new = jobs.submit(REQUEST, actor="tester", key="morning run")
    assert new
    assert jobs.submit(REQUEST, actor="tester", key="morning run") == (first, False)
    with pytest.raises(IdempotencyKeyError, match=first.id):
        jobs.submit(another(5), actor="tester", key="morning run")
    assert [job.id for job in jobs.list()] == [first.id]


def test_of_many_with_one_key_at_once_exactly_one_makes_the_job(jobs):
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: jobs.submit(REQUEST, actor="tester", key="once"), range(8)))
    assert sum(new for _, new in answers) == 1
    assert len({job.id for job, _ in answers}) == 1


def test_of_many_at_once_as_many_get_in_as_there_are_places(jobs):
    def submit(number):
        try:
            return jobs.submit(another(number), actor="tester")[0].id
        except QueueFullError as error:
            turned_away.append((error.waiting, error.retry_after_s > 0))
            return None

    turned_away = []

    with ThreadPoolExecutor(8) as pool:
        accepted = [found for found in pool.map(submit, range(24)) if found]
    assert len(accepted) == 8
    assert turned_away == [(8, True)] * 16
    assert {job.id for job in jobs.list()} == set(accepted)
    assert jobs.counts() == {"queued": 8, "running": 0}
    jobs.cancel(accepted[0])
    assert submit(99)


def test_a_known_key_is_answered_even_when_the_queue_is_full(jobs):
    first, _ = jobs.submit(REQUEST, actor="tester", key="first")
    for number in range(7):
        jobs.submit(another(number), actor="tester")
    assert jobs.submit(REQUEST, actor="tester", key="first") == (first, False)


@pytest.mark.slow
def test_pages_put_together_are_the_list(jobs):
    models = random.Random(1).choices(["one", "two"], k=8)
    ids = [jobs.submit(another(number, model=model), actor="t")[0].id for number, model in enumerate(models)]
    jobs.cancel(ids[2])
    assert [job.id for job in jobs.list()] == ids[::-1]
    for limit in (1, 3, 8):
        pages, before = [], None
        while page := jobs.list(limit=limit, before=before):
            assert len(page) <= limit
            pages += page
            before = page[-1].id
        assert [job.id for job in pages] == ids[::-1]
    for model in ("one", "two", "three"):
        assert [job.request.model for job in jobs.list(model=model)] == [model] * models.count(model)
    assert [job.id for job in jobs.list(state="cancelled")] == [ids[2]]
    assert len(jobs.list(state="queued")) == 7
    with pytest.raises(JobNotFoundError):
        jobs.list(before="nothing")


def test_a_cancelled_job_is_ended_and_stays_so(jobs):
    job_id = jobs.submit(REQUEST, actor="tester")[0].id
    cancelled = jobs.cancel(job_id)
    assert cancelled.state == "cancelled"
    assert cancelled.finished_at
    with pytest.raises(JobStateError, match="cancelled"):
        jobs.cancel(job_id)
    for call in (jobs.get, jobs.cancel, jobs.events):
        with pytest.raises(JobNotFoundError, match="nothing"):
            call("nothing")


@pytest.mark.slow
def test_events_go_on_after_any_of_them_and_end_with_the_state(jobs, clock):
    job_id = jobs.submit(REQUEST, actor="tester")[0].id
    (queued,) = jobs.events(job_id)
    assert (queued.number, queued.kind, queued.data) == (0, "state", {"state": "queued"})
    started, fairly = time.monotonic(), clock()
    assert jobs.events(job_id, after=0, wait_s=0.3) == ()
    assert time.monotonic() - started > 0.25
    assert clock() - fairly < 2
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(jobs.events, job_id, 0, 60)
        time.sleep(0.2)
        jobs.cancel(job_id)
        (last,) = waiting.result(30)
    assert (last.number, last.data) == (1, {"state": "cancelled"})
    assert jobs.events(job_id) == (queued, last)
    assert jobs.events(job_id, after=1, wait_s=5) == jobs.events(job_id, after=7) == ()


def test_datasets_of_jobs_that_wait_are_in_use(jobs):
    first = jobs.submit(another(datasets=("a" * 64, "b" * 64)), actor="t")[0].id
    second = jobs.submit(another(datasets=("b" * 64,)), actor="t")[0].id
    assert {name: set(ids) for name, ids in jobs.active_datasets().items()} == {
        "a" * 64: {first},
        "b" * 64: {first, second},
    }
    jobs.cancel(second)
    assert jobs.active_datasets() == {"a" * 64: (first,), "b" * 64: (first,)}


@pytest.mark.parametrize("url", ["postgresql://me:secret@127.0.0.1:9/jobs", "sqlite:////proc/no/jobs.sqlite"])
def test_a_database_that_cannot_be_reached_is_said_soon_and_without_the_password(url, clock):
    jobs = JobQueue.open(url, 8)
    started = clock()
    for call in (jobs.list, jobs.counts, lambda: jobs.submit(REQUEST, actor="t"), lambda: jobs.get("x")):
        with pytest.raises(JobsUnavailableError) as raised:
            call()
        assert "secret" not in str(raised.value)
    assert clock() - started < 8


@pytest.mark.slow
def test_one_who_keeps_the_file_locked_holds_nobody_up_for_long(tmp_path, clock):
    jobs = JobQueue.open(f"sqlite:///{tmp_path / 'jobs.sqlite'}", 8)
    first = jobs.submit(REQUEST, actor="t")[0].id
    with closing(sqlite3.connect(tmp_path / "jobs.sqlite", isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        assert jobs.get(first).state == "queued"  # readers need not wait
        started = clock()
        with pytest.raises(JobsUnavailableError, match="another process"):
            jobs.submit(another(1), actor="t")
        assert clock() - started < 6
    assert jobs.submit(another(1), actor="t")[1]
    jobs.close()


@pytest.mark.kills
def test_a_server_that_was_killed_is_found_again(postgres, clock):
    jobs = JobQueue.open(postgres.new_database(), 8)
    first = jobs.submit(REQUEST, actor="t")[0].id
    postgres.kill()
    started = clock()
    with pytest.raises(JobsUnavailableError):
        jobs.get(first)
    assert clock() - started < 6
    postgres.start()
    assert jobs.get(first).id == first
    assert jobs.submit(another(1), actor="t")[1]
    jobs.close()


def test_two_who_come_first_at_once_both_find_the_tables(jobs_url):
    queues = [JobQueue.open(jobs_url, 8) for _ in range(4)]
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda each: each.submit(REQUEST, actor="t", key="k")[1], queues))
    assert sum(answers) == 1
    for each in queues:
        each.close()


def test_checked_requests_name_whole_datasets(store):
    (dataset,) = store.dataset_ids()
    for reference in ("unit", dataset, dataset[:8]):
        checked = check_request(store, another(datasets=(reference,)))
        assert checked.datasets == (dataset,)
        assert check_request(store, checked) == checked
        assert checked.training_config().datasets == [dataset]


def test_what_cannot_work_is_refused_before_it_is_queued(store):
    put_dataset(store, "wide", stored_runs()[:3], wheel_radius_m=0.5)
    slopes = {run.slope_deg for run in stored_runs()}
    refused = {
        "datasets": [("unit", "unit"), ("unit", "wide")],
        "split": [SplitRequest(test_slopes_deg=(77.0,)), SplitRequest(test_fraction=0.9)],
    }
    for field, values in refused.items():
        for value in values:
            asked = REQUEST.model_copy(update={"datasets": ("unit",), field: value})
            with pytest.raises(InvalidValueError, match=field):
                check_request(store, asked)
    with pytest.raises(DatasetNotFoundError):
        check_request(store, another(datasets=("gone",)))
    assert 77.0 not in slopes


def test_runs_that_vary_are_refused_for_a_model_that_would_take_them_for_constant(store):
    put_dataset(store, "drives", varying_runs())
    names = [run.name for run in varying_runs() if run.varies]
    with pytest.raises(InvalidValueError, match=f"constant slope and torque; in drives they change .*{names[0]}"):
        check_request(store, another(datasets=("drives",), architecture="paper_network"))
    assert check_request(store, another(datasets=("drives",), architecture="drive_model"))


def test_a_slope_that_no_run_has_is_refused_with_the_nearest_ones(store):
    asked = another(datasets=("unit",), split=SplitRequest(test_slopes_deg=(5.0, 5.5)))
    with pytest.raises(InvalidValueError, match=r"split.test_slopes_deg is 5.5, .*nearest are 0, 5, 10"):
        check_request(store, asked)
    assert check_request(store, another(datasets=("unit",), split=SplitRequest(test_slopes_deg=(5.0,))))


def test_the_runs_that_are_left_are_counted_as_they_will_be_divided(store):
    slopes = sorted({run.slope_deg for run in stored_runs()})
    all_but_two = SplitRequest(test_slopes_deg=tuple(slopes[2:]))
    with pytest.raises(InvalidValueError, match="leaves 3 of the"):
        check_request(store, another(datasets=("unit",), split=all_but_two))
    assert check_request(store, another(datasets=("unit",), split=all_but_two, architecture="zero"))


def test_datasets_that_share_a_run_are_refused_by_the_runs_name(store):
    put_dataset(store, "again", stored_runs()[:2])
    with pytest.raises(InvalidValueError, match=rf"datasets .* share no run; {stored_runs()[0].name}"):
        check_request(store, another(datasets=("unit", "again")))


@pytest.mark.parametrize(
    "wrong",
    [
        {"model": "No Name"},
        {"datasets": []},
        {"datasets": ["x"] * 65},
        {"architecture": "magic"},
        {"inputs": ["slope_deg", "time_s"]},
        {"inputs": ["time_s", "time_s"]},
        {"seed": -1},
        {"budget": {"max_epochs": 0}},
        {"budget": {"max_minutes": 0}},
        {"budget": {"max_minutes": float("nan")}},
        {"split": {"test_fraction": 0.95}},
        {"split": {"test_slopes_deg": [100]}},
        {"promote": "always"},
        {"margin": 0.6},
        {"description": "x" * 1001},
        {"unknown": 1},
    ],
    ids=str,
)
def test_requests_out_of_range_are_no_requests(wrong):
    with pytest.raises(ValidationError):
        TrainingJobRequest.model_validate({"model": "my-rover", "datasets": ["unit"], **wrong})
    assert Budget().max_minutes > 0


def test_a_job_that_an_earlier_release_accepted_is_read_as_what_replaced_its_architecture():
    kept = another().model_dump(mode="json") | {"architecture": "resistance_process"}
    assert stored_request(kept) == another(architecture="drive_model")
    with pytest.raises(ValidationError, match="'drive_model', 'paper_network' or 'zero'"):
        TrainingJobRequest.model_validate(kept)
