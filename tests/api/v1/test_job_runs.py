"""Training jobs over HTTP that a real worker carries out: what is told meanwhile, what is there afterwards."""

from __future__ import annotations

import pytest

from tests.api.training import ADDRESS, admin_serving, damage, job_store, submit, working
from tests.api.v1.test_job_events import following, parsed, read, states
from tests.fair_clock import fair_clock

pytestmark = pytest.mark.processes

PATIENCE_S = 120


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """A service and a worker on one store."""
    store = job_store(tmp_path_factory.mktemp("store"))
    damage(store, "damaged")
    with admin_serving(store) as running, working(store):
        running.wait_ready()
        running.client.timeout = PATIENCE_S
        yield running


@pytest.fixture(scope="module")
def admin(running):
    return running.client


@pytest.fixture(scope="module")
def followed(admin):
    """A job followed live over a connection that breaks after every three events; (the job as it ended, events)."""
    job = submit(admin)
    events, resume = [], {}
    while not events or events[-1][2].get("state") not in ("succeeded", "failed"):
        with following(admin, job, **resume) as answer:
            for _, event in zip(range(3), parsed(answer.iter_lines()), strict=False):
                events.append(event)
        resume = {"Last-Event-ID": str(events[-1][0])}
    return admin.get(job["links"]["self"]).json(), events


def test_every_event_comes_once_however_often_the_connection_breaks(admin, followed):
    job, events = followed

    assert [number for number, _, _ in events] == list(range(len(events)))
    assert read(admin, job) == events


def test_the_rest_of_a_stream_can_be_had_from_any_event(admin, followed):
    job, events = followed
    for number in range(len(events) - 1):
        assert read(admin, job, **{"Last-Event-ID": str(number)}) == events[number + 1 :]
    assert admin.get(job["links"]["events"], params={"after": len(events) - 1}).status_code == 204


def test_states_follow_each_other_and_progress_only_grows(followed):
    job, events = followed
    fractions = [data["fraction"] for _, kind, data in events if kind == "progress"]
    times = [data["time"] for _, _, data in events]

    assert [state for _, state in states(events)] == ["queued", "running", "succeeded"], job["failure"]
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] < fractions[-1] <= 1
    assert any(data.get("epoch") and data["train_error_m"] > 0 for _, kind, data in events if kind == "progress")
    assert times == sorted(times)
    assert events[-1][2]["result"] == job["result"]


def test_the_job_leads_to_the_version_it_made(admin, followed):
    job, _ = followed
    manifest = admin.get(job["links"]["version"]).json()
    aliases = admin.get("/v1/models/rover/aliases").json()["aliases"]

    assert (job["state"], job["attempts"], job["links"]["cancel"]) == ("succeeded", 1, None)
    assert manifest["lineage"]["job"] == job["id"]
    assert manifest["lineage"]["datasets"] == job["request"]["datasets"]
    assert aliases["candidate"]["version"] == manifest["version"] == job["result"]["version"]
    assert "champion" not in aliases
    assert job["result"]["promoted"] is False
    assert job["created_at"] <= job["started_at"]
    assert job["finished_at"]


def test_the_log_is_the_same_as_text_as_json_and_in_pages(admin, followed):
    job, events = followed
    told = [(number, data["message"]) for number, kind, data in events if kind == "log"]
    whole = admin.get(job["links"]["logs"], headers={"Accept": "application/json"}).json()
    text = admin.get(job["links"]["logs"])
    lines, address = [], f"{job['links']['logs']}?limit=2"
    while address:
        page = admin.get(address, headers={"Accept": "application/json"})
        assert len(page.json()["lines"]) <= 2
        assert page.headers.get("link") == (f'<{page.json()["next"]}>; rel="next"' if page.json()["next"] else None)
        lines += page.json()["lines"]
        address = page.json()["next"]

    assert len(told) >= 2
    assert [(line["number"], line["message"]) for line in whole["lines"]] == told
    assert whole["next"] is None
    assert lines == whole["lines"]
    assert [line.partition(" ")[2] for line in text.text.splitlines()] == [message for _, message in told]


def test_a_running_job_is_cancelled_within_seconds_and_leaves_nothing(admin, running):
    job = submit(admin, model="never", budget={"max_epochs": 10_000})
    with following(admin, job) as answer, fair_clock() as clock:
        events = parsed(answer.iter_lines())
        next(event for event in events if event[1] == "progress" and event[2].get("epoch"))
        shown = admin.get(job["links"]["self"]).json()
        began = clock()
        cancelled = admin.post(job["links"]["cancel"])
        rest = list(events)
        took = clock() - began

    assert (shown["state"], shown["attempts"]) == ("running", 1)
    assert 0 < shown["progress"]["fraction"] < 1
    assert (cancelled.status_code, cancelled.json()["state"]) == (202, "cancelled")
    assert rest[-1][2]["state"] == "cancelled"
    assert took < 10
    after = submit(admin, architecture="zero")  # the worker is free again, and nothing of the other came after all
    assert read(admin, after)[-1][2]["state"] == "succeeded"
    assert "never" not in running.store.model_names()
    assert admin.get(job["links"]["self"]).json()["state"] == "cancelled"


def test_a_job_that_fails_says_why_and_what_to_do(admin):
    job = submit(admin, datasets=["damaged"])
    last = read(admin, job)[-1][2]
    shown = admin.get(job["links"]["self"]).json()

    assert (last["state"], shown["state"], shown["result"]) == ("failed", "failed", None)
    assert last["failure"] == shown["failure"]
    assert shown["failure"]["message"]
    assert shown["failure"]["remedy"]
    assert "Traceback" not in shown["failure"]["message"]
    assert [each["id"] for each in admin.get(ADDRESS, params={"state": "failed"}).json()["jobs"]] == [job["id"]]
