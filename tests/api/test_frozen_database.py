"""A PostgreSQL that stands still: jobs are answered with a 503 in seconds, everything else as before, and it heals."""

from __future__ import annotations

import signal
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import pytest

from model_store import ModelStore
from tests.api.conftest import PLAIN, QUESTION, process_serving
from tests.api.training import ADDRESS, ASKED, HEADERS, TOKEN, job_store
from tests.databases import start_postgres
from tests.jobs.nursery import until

pytestmark = pytest.mark.processes

ANSWER_WITHIN_S = 5.0
DRAIN_S, GRACE_S = 1, 6
SOME_JOB = f"{ADDRESS}/0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10"
CALLS = {
    "list": ("GET", ADDRESS, {}),
    "submit": ("POST", ADDRESS, {"json": ASKED}),
    "submit once": ("POST", ADDRESS, {"json": ASKED, "headers": {"Idempotency-Key": "a-key-of-this-test"}}),
    "one": ("GET", SOME_JOB, {}),
    "cancel": ("POST", f"{SOME_JOB}/cancel", {}),
    "log": ("GET", f"{SOME_JOB}/logs", {}),
    "events": ("GET", f"{SOME_JOB}/events", {}),
}


@pytest.fixture(scope="module")
def postgres():
    yield from start_postgres()


@contextmanager
def frozen(postgres):
    postgres.freeze()
    try:
        yield
    finally:
        postgres.thaw()


def service(postgres, folder, **settings):
    chosen = {
        "admin_token": TOKEN,
        "jobs_database_url": postgres.new_database(),
        "drain_s": DRAIN_S,
        "shutdown_grace_s": GRACE_S,
        "default_model": "viper-lunar",
        "log_level": "error",
        "max_queued_jobs": 1000,
    }
    return process_serving(ModelStore.open(str(job_store(folder))), **(chosen | settings))


def timed(client, call):
    method, address, more = CALLS[call]
    with httpx.Client(base_url=client.base_url, timeout=60, **PLAIN) as own:
        began = time.monotonic()
        answer = own.request(method, address, **{**more, "headers": HEADERS | more.get("headers", {})})
        return answer.status_code, time.monotonic() - began


def test_jobs_are_unavailable_in_seconds_whoever_asks_and_predictions_go_on(postgres, tmp_path):
    """All calls at once, several times over: more than there are threads. Then the end comes in time, too."""
    with service(postgres, tmp_path, start_worker="false") as (client, process):
        job = client.post(ADDRESS, json=ASKED, headers=HEADERS).json()["id"]
        with frozen(postgres):
            with ThreadPoolExecutor(28) as pool:
                asked = [pool.submit(timed, client, call) for call in list(CALLS) * 4]
                time.sleep(0.3)
                assert client.get("/v1/predictions", params=QUESTION).status_code == 200
                assert client.get("/health/ready").status_code == 200
                answers = [each.result() for each in asked]
            assert {status for status, _ in answers} == {503}
            assert max(took for _, took in answers) <= ANSWER_WITHIN_S
        until(lambda: client.get(f"{ADDRESS}/{job}", headers=HEADERS).status_code == 200, 30, "it heals")
        with frozen(postgres):
            timed(client, "list")
            began = time.monotonic()
            process.send_signal(signal.SIGTERM)
            process.wait(60)
            assert time.monotonic() - began <= DRAIN_S + GRACE_S


def test_a_stream_of_events_ends_and_goes_on_after_it(postgres, tmp_path):
    with service(postgres, tmp_path, start_worker="false") as (client, _):
        job = client.post(ADDRESS, json=ASKED, headers=HEADERS).json()["id"]
        with client.stream("GET", f"{ADDRESS}/{job}/events", headers=HEADERS) as stream:
            lines = stream.iter_lines()
            assert any(line.startswith("id: 0") for line in lines)
            with frozen(postgres):
                began = time.monotonic()
                assert list(lines) is not None  # it ends
                assert time.monotonic() - began <= 2 * ANSWER_WITHIN_S
        again = until(lambda: _events(client, job), 30)
        assert "queued" in again


def _events(client, job):
    with client.stream("GET", f"{ADDRESS}/{job}/events", headers=HEADERS) as stream:
        return next((line for line in stream.iter_lines() if line.startswith("data: ")), None)


def test_a_worker_survives_it_and_goes_on(postgres, tmp_path):
    with service(postgres, tmp_path) as (client, _):
        first = client.post(ADDRESS, json=ASKED, headers=HEADERS).json()["id"]
        until(lambda: _state(client, first) not in ("queued", None), 120, "the worker takes a job")
        with frozen(postgres):
            time.sleep(8)
        until(lambda: _state(client, first) == "succeeded", 120, "the job ends well")


def _state(client, job):
    answer = client.get(f"{ADDRESS}/{job}", headers=HEADERS)
    return answer.json().get("state") if answer.is_success else None
