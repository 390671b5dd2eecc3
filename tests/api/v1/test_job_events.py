"""Following a training job live: server-sent events, resumed anywhere, bounded, ended when they should be."""

from __future__ import annotations

import json
import threading
import time
from contextlib import contextmanager

import httpx
import pytest

from service.jobs.job import ENDED
from tests.api.training import ADDRESS, admin_client, admin_serving, job_store, submit
from tests.fair_clock import fair_clock

HEARTBEAT_S = 0.2


@pytest.fixture(scope="module")
def admin(tmp_path_factory):
    """A service with nobody who works, whose heartbeat is quick."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("service.api.http.event_stream.HEARTBEAT_S", HEARTBEAT_S)
        with admin_client(job_store(tmp_path_factory.mktemp("store"))) as client:
            yield client


@contextmanager
def following(client, job, **headers):
    with client.stream("GET", job["links"]["events"], headers=headers) as answer:
        assert answer.status_code == 200, answer.read()
        yield answer


def parsed(lines):
    """Events as (number, kind, data); comments and the reconnection time are left out."""
    event = {}
    for line in lines:
        if line.startswith(":"):
            continue
        if line:
            name, _, value = line.partition(": ")
            event[name] = value
        else:
            if "data" in event:
                yield int(event["id"]), event["event"], json.loads(event["data"])
            event = {}


def read(client, job, **headers):
    """All events up to the end of the stream."""
    with following(client, job, **headers) as answer:
        return list(parsed(answer.iter_lines()))


def states(events):
    return [(number, data["state"]) for number, kind, data in events if kind == "state"]


@pytest.fixture
def cancelled(admin):
    job = submit(admin)
    return admin.post(job["links"]["cancel"]).json()


@pytest.mark.slow
def test_a_stream_begins_with_the_queue_and_ends_with_the_last_state(admin, cancelled):
    assert states(read(admin, cancelled)) == [(0, "queued"), (1, "cancelled")]


def test_it_goes_on_after_the_last_event_that_came(admin, cancelled):
    assert states(read(admin, cancelled, **{"Last-Event-ID": "0"})) == [(1, "cancelled")]
    answer = admin.get(cancelled["links"]["events"], params={"after": 0})
    assert states(parsed(answer.text.splitlines())) == [(1, "cancelled")]


def test_the_header_wins_over_the_query(admin, cancelled):
    """A browser that reconnects repeats the address it began with."""
    answer = admin.get(cancelled["links"]["events"], params={"after": 0}, headers={"Last-Event-ID": "1"})

    assert answer.status_code == 204


@pytest.mark.parametrize("after", [1, 2, 999_999_999])
def test_nothing_after_the_end_means_do_not_come_back(admin, cancelled, after):
    answer = admin.get(cancelled["links"]["events"], headers={"Last-Event-ID": str(after)})

    assert (answer.status_code, answer.content) == (204, b"")


def test_an_empty_event_number_is_none(admin, cancelled):
    assert read(admin, cancelled, **{"Last-Event-ID": ""}) == read(admin, cancelled)


@pytest.mark.parametrize("sent", ["-1", "x", "1x", "1.5", "9" * 20, "\u00b2".encode().decode("latin-1")])
def test_an_event_number_that_cannot_be_read(admin, cancelled, sent):
    answer = admin.get(cancelled["links"]["events"], headers={"Last-Event-ID": sent.encode("latin-1")})

    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "Last-Event-ID"


def test_the_answer_is_not_stored_compressed_or_held_back(admin, cancelled):
    with following(admin, cancelled, **{"Accept-Encoding": "gzip, br, deflate, zstd"}) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        assert "content-encoding" not in answer.headers
        assert answer.headers["x-accel-buffering"] == "no"
        assert {"no-store", "no-transform"} <= {part.strip() for part in answer.headers["cache-control"].split(",")}
        assert "retry: 2000" in answer.read().decode().splitlines()


@pytest.mark.slow
def test_what_happens_is_told_while_the_stream_is_open(admin):
    job = submit(admin)
    with following(admin, job) as answer, fair_clock() as clock:
        events = parsed(answer.iter_lines())
        assert next(events)[2]["state"] == "queued"
        admin.post(job["links"]["cancel"])
        asked = clock()
        assert next(events)[2]["state"] == "cancelled"
        took = clock() - asked
        assert list(events) == []

    assert took < 3.0


@pytest.mark.slow
def test_a_quiet_stream_has_a_heartbeat(admin):
    job = submit(admin)
    began = time.monotonic()
    with following(admin, job) as answer, fair_clock() as clock:
        lines = answer.iter_lines()
        fairly, beats = clock(), 0
        while beats < 4:
            beats += next(lines).startswith(":")
        assert time.monotonic() - began >= 3 * HEARTBEAT_S
        assert clock() - fairly < 10
    admin.post(job["links"]["cancel"])


@pytest.mark.slow
def test_listeners_are_bounded_and_a_place_is_free_again_afterwards(tmp_path, monkeypatch, question):
    monkeypatch.setattr("service.api.services.MOST_LISTENERS", 3)
    with admin_client(job_store(tmp_path)) as admin:
        job = submit(admin)
        with following(admin, job), following(admin, job):
            with following(admin, job):
                refused = admin.get(job["links"]["events"])
                assert refused.status_code == 503
                assert refused.json()["type"].endswith(":overloaded")
                assert int(refused.headers["retry-after"]) >= 1
                assert admin.get("/v1/predictions", params=question).status_code == 200
                # those who are told that there is nothing take no place
                ended = submit(admin)
                admin.post(ended["links"]["cancel"])
                assert admin.get(ended["links"]["events"], params={"after": 9}).status_code == 204
            deadline = time.monotonic() + 30
            while (answer := _first_status(admin, job)) == 503 and time.monotonic() < deadline:
                time.sleep(0.05)
            assert answer == 200


def _first_status(client, job):
    with client.stream("GET", job["links"]["events"]) as answer:
        return answer.status_code


@pytest.mark.slow
def test_an_open_stream_does_not_hold_up_the_end_of_the_service(tmp_path):
    with httpx.Client(timeout=60, trust_env=False) as outside, fair_clock() as clock:
        with admin_serving(job_store(tmp_path)) as running:
            outside.headers.update(running.client.headers)
            job = submit(running.client)
            opened, ended = threading.Event(), []

            def follow():
                with outside.stream("GET", running.url + job["links"]["events"]) as answer:
                    lines = answer.iter_lines()
                    next(lines)
                    opened.set()
                    ended.append(list(parsed(lines)))

            listener = threading.Thread(target=follow)
            listener.start()
            assert opened.wait(30)
            began = clock()
        took = clock() - began  # the service's grace for running requests is 30 s
        listener.join(timeout=30)

    assert took < 15
    assert states(ended[0]) == [(0, "queued")]  # the end of the stream was proper: nothing was raised


@pytest.mark.slow
def test_a_database_that_fails_ends_the_stream_and_not_the_service(tmp_path, monkeypatch):
    from service.errors import JobsUnavailableError
    from service.jobs.queue import JobQueue

    with admin_client(job_store(tmp_path)) as admin:
        job = submit(admin)
        with following(admin, job) as answer:
            events = parsed(answer.iter_lines())
            assert next(events)[0] == 0

            def fails(*_args, **_named):
                raise JobsUnavailableError("gone")

            with monkeypatch.context() as patch:
                patch.setattr(JobQueue, "events", fails)
                assert list(events) == []
                assert admin.get(job["links"]["events"], headers={"Last-Event-ID": "0"}).status_code == 503
        admin.post(job["links"]["cancel"])
        assert states(read(admin, job, **{"Last-Event-ID": "0"})) == [(1, "cancelled")]


def test_a_stream_lasts_an_hour_at_most_and_can_be_taken_up_again(admin, monkeypatch):
    monkeypatch.setattr("service.api.v1.admin.job_events.LONGEST_STREAM_S", 0.0)
    job = submit(admin)

    assert states(read(admin, job)) == [(0, "queued")]
    admin.post(job["links"]["cancel"])
    assert states(read(admin, job, **{"Last-Event-ID": "0"})) == [(1, "cancelled")]


@pytest.mark.slow
def test_the_log_of_a_job_that_said_nothing_is_empty(admin, cancelled):
    text = admin.get(cancelled["links"]["logs"])
    document = admin.get(cancelled["links"]["logs"], headers={"Accept": "application/json"})

    assert (text.status_code, text.text) == (200, "")
    assert text.headers["content-type"].startswith("text/plain")
    assert document.json() == {"lines": [], "next": None}
    assert admin.get(cancelled["links"]["logs"], headers={"Accept": "image/png"}).status_code == 406
    assert cancelled["state"] in ENDED
    assert cancelled["links"]["self"].startswith(ADDRESS)
