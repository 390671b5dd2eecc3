"""Training jobs over HTTP, on a real queue in SQLite: asking, looking, stopping. test_job_events.py follows them."""

from __future__ import annotations

import json
import socket
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from service.api.http.reading import words_of
from service.api.v1.admin.idempotency import parse_key
from service.api.v1.admin.job_answers import JobAnswer, JobsAnswer
from service.errors import InvalidValueError
from service.jobs.request import TrainingJobRequest
from tests.api.training import ADDRESS, ASKED, HEADERS, admin_client, job_store, submit
from tests.fair_clock import fair_clock

SOMEWHERE = "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10"


@pytest.fixture(scope="module")
def admin(tmp_path_factory):
    """A service with the admin endpoints on and nobody who works: what is queued stays queued."""
    with admin_client(job_store(tmp_path_factory.mktemp("store"))) as client:
        yield client


def ids(client, **query):
    return [job["id"] for job in client.get(ADDRESS, params=query).json()["jobs"]]


def slug_of(answer):
    assert answer.headers["content-type"] == "application/problem+json", answer.text
    return answer.json()["type"].rpartition(":")[2]


@pytest.mark.slow
def test_a_job_is_queued_and_the_answer_says_where_it_is(admin):
    answer = admin.post(ADDRESS, json=ASKED | {"promote": "if_better", "seed": 7})
    job = answer.json()

    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == job["links"]["self"] == f"{ADDRESS}/{job['id']}"
    assert int(answer.headers["retry-after"]) >= 1
    assert JobAnswer.model_validate(job).model_dump(mode="json") == job
    assert (job["state"], job["actor"], job["attempts"]) == ("queued", "admin", 0)
    assert (job["progress"], job["result"], job["failure"]) == (None, None, None)
    assert (job["request"]["promote"], job["request"]["seed"], job["request"]["margin"]) == ("if_better", 7, 0.05)
    assert admin.get(answer.headers["location"]).json() == job


def test_names_of_datasets_become_ids_and_the_actor_is_kept(admin):
    job = admin.post(ADDRESS, json=ASKED).json()
    (dataset,) = job["request"]["datasets"]

    assert len(dataset) == 64
    assert job["actor"] == "admin"
    assert submit(admin, datasets=[dataset[:10]])["request"]["datasets"] == [dataset]


def test_the_same_key_and_request_are_the_same_job(admin):
    first = admin.post(ADDRESS, json=ASKED, headers={"Idempotency-Key": '"monday 1"'})
    again = admin.post(ADDRESS, json=ASKED, headers={"Idempotency-Key": '"monday 1"'})

    assert (first.status_code, again.status_code) == (202, 202)
    assert first.json() == again.json()
    assert first.headers["location"] == again.headers["location"]
    assert ids(admin, limit=500).count(first.json()["id"]) == 1


def test_a_key_means_the_same_bare_and_in_quotes(admin):
    bare = admin.post(ADDRESS, json=ASKED, headers={"Idempotency-Key": "8e03978e-40d5"})
    quoted = admin.post(ADDRESS, json=ASKED, headers={"Idempotency-Key": '"8e03978e-40d5"'})

    assert bare.json()["id"] == quoted.json()["id"]


def test_one_key_sent_many_times_at_once_makes_one_job(admin):
    headers = {"Idempotency-Key": "at-once"}
    with ThreadPoolExecutor(12) as pool:
        asked = [pool.submit(admin.post, ADDRESS, json=ASKED, headers=headers) for _ in range(12)]
        answers = [each.result() for each in asked]

    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1


def test_a_key_for_another_request_is_refused(admin):
    before = admin.post(ADDRESS, json=ASKED, headers={"Idempotency-Key": "taken"}).json()
    answer = admin.post(ADDRESS, json=ASKED | {"seed": 99}, headers={"Idempotency-Key": "taken"})

    assert (answer.status_code, slug_of(answer)) == (422, "idempotency-key-reused")
    assert before["id"] in answer.json()["detail"]
    assert admin.get(f"{ADDRESS}/{before['id']}").json()["request"]["seed"] == before["request"]["seed"]


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('"a b"', "a b"),
        (r'"say \"hi\" \\"', r'say "hi" \ '.strip()),
        ("a" * 255, "a" * 255),
        ('" "', " "),
        ("  x ", "x"),
    ],
)
def test_keys_that_can_be_read(text, key):
    assert parse_key(text) == key


BAD_KEYS = ["", '""', '"open', 'a"b', "two words", "a" * 256, f'"{"a" * 256}"', r'"\n"', "caf\u00e9", "a\\b"]


@pytest.mark.parametrize("text", BAD_KEYS)
def test_keys_that_cannot_be_read(text):
    with pytest.raises(InvalidValueError, match="255"):
        parse_key(text)


@pytest.mark.parametrize("keys", [['"open'], ["a", "b"]])
def test_a_malformed_key_queues_nothing(admin, keys):
    before = ids(admin, limit=500)
    headers = [*(("Idempotency-Key", key) for key in keys), ("Content-Type", "application/json")]
    answer = admin.post(ADDRESS, content=json.dumps(ASKED), headers=headers)

    assert (answer.status_code, slug_of(answer)) == (422, "invalid-input")
    assert answer.json()["errors"][0]["field"] == "Idempotency-Key"
    assert ids(admin, limit=500) == before


BAD_REQUESTS = {
    "no model": ({"model": None}, "model"),
    "malformed model": ({"model": "Not A Name"}, "model"),
    "no datasets": ({"datasets": []}, "datasets"),
    "too many datasets": ({"datasets": ["unit"] * 65}, "datasets"),
    "unknown dataset": ({"datasets": ["absent"]}, "datasets"),
    "malformed dataset": ({"datasets": ["../../etc"]}, "datasets"),
    "a dataset twice": ({"datasets": ["unit", "unit"]}, "datasets"),
    "datasets of two rovers": ({"datasets": ["unit", "other-rover"]}, "datasets"),
    "unknown architecture": ({"architecture": "transformer"}, "architecture"),
    "unknown prior": ({"prior": "guess"}, "prior"),
    "time is missing": ({"inputs": ["slope_deg"]}, "inputs"),
    "unknown input": ({"inputs": ["time_s", "colour"]}, "inputs"),
    "unknown split": ({"split": {"test_share": 0.5}}, "split.test_share"),
    "split too large": ({"split": {"test_fraction": 0.95}}, "split.test_fraction"),
    "split is no object": ({"split": "half"}, "split"),
    "a slope that no run has": ({"split": {"test_slopes_deg": [77]}}, "split.test_slopes_deg"),
    "NaN": ({"margin": float("nan")}, "margin"),
    "margin": ({"margin": 0.6}, "margin"),
    "text for a number": ({"seed": "7"}, "seed"),
    "seed": ({"seed": -1}, "seed"),
    "no epochs": ({"budget": {"max_epochs": 0}}, "budget.max_epochs"),
    "endless": ({"budget": {"max_minutes": 1e9}}, "budget.max_minutes"),
    "promote": ({"promote": "always"}, "promote"),
    "long description": ({"description": "x" * 1001}, "description"),
    "unknown field": ({"learning_rate": 1}, "learning_rate"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("change", "field"), BAD_REQUESTS.values(), ids=BAD_REQUESTS)
def test_what_cannot_work_is_refused_before_it_is_queued(admin, change, field):
    before = ids(admin, limit=500)
    body = {name: value for name, value in (ASKED | change).items() if value is not None}
    answer = admin.post(ADDRESS, content=json.dumps(body), headers={"Content-Type": "application/json"})

    assert (answer.status_code, slug_of(answer)) == (422, "invalid-input"), answer.text
    faults = answer.json()["errors"]
    assert [each["field"] for each in faults] == [field]
    assert faults[0]["allowed"]
    assert ids(admin, limit=500) == before


def test_every_field_says_in_words_what_it_accepts():
    names = set(TrainingJobRequest.model_fields) | {
        f"{name}.{inner}"
        for name in ("split", "budget")
        for inner in TrainingJobRequest.model_fields[name].annotation.model_fields
    }

    words = words_of(TrainingJobRequest)
    assert set(words) == names
    assert not [name for name, each in words.items() if each in ("text", "another value", "a list of text")]


@pytest.mark.parametrize(
    ("body", "kind", "status", "slug"),
    [
        (b"", "application/json", 400, "malformed-body"),
        (b"{", "application/json", 400, "malformed-body"),
        (b"\xff\xfe", "application/json", 400, "malformed-body"),
        (b"[" * 30_000, "application/json", 400, "malformed-body"),
        (b'{"seed": ' + b"9" * 6000 + b"}", "application/json", 400, "malformed-body"),
        (b"[]", "application/json", 422, "invalid-input"),
        (b"null", "application/json", 422, "invalid-input"),
        (b"model=a", "application/x-www-form-urlencoded", 415, "unsupported-media-type"),
        (b"{}", "", 415, "unsupported-media-type"),
        (b'{"model": "a", "model": "b", "datasets": ["unit"]}', "application/json", 422, "invalid-input"),
        (b'{"model": "a", "datasets": ["unit"], "split": {"test_fraction": 0, "test_fraction": 0.1}}',
         "application/json", 422, "invalid-input"),
        (b" " * 70_000, "application/json", 413, "body-too-large"),
    ],
    ids=["empty", "cut off", "no UTF-8", "deep", "huge number", "list", "null", "form", "no type", "a field twice",
         "an inner field twice", "too large"],
)  # fmt: skip
def test_bodies_that_cannot_be_read(admin, body, kind, status, slug):
    answer = admin.post(ADDRESS, content=body, headers={"Content-Type": kind} if kind else {})

    assert (answer.status_code, slug_of(answer)) == (status, slug), answer.text


@pytest.mark.slow
def test_pages_show_every_job_once_newest_first(tmp_path):
    with admin_client(job_store(tmp_path)) as admin:
        made = [submit(admin, model="a" if n % 2 else "b", seed=n)["id"] for n in range(7)]
        seen, address = [], f"{ADDRESS}?limit=3"
        while address:
            page = admin.get(address).json()
            assert JobsAnswer.model_validate(page).model_dump(mode="json") == page
            assert len(page["jobs"]) <= 3
            seen += [job["id"] for job in page["jobs"]]
            address = page["next"]
        assert seen == made[::-1]

        admin.post(f"{ADDRESS}/{made[0]}/cancel")
        assert ids(admin, state="cancelled") == [made[0]]
        assert ids(admin, state="queued") == made[:0:-1]
        assert ids(admin, model="a") == made[5::-2]
        page = admin.get(ADDRESS, params={"model": "b", "state": "queued", "limit": 2}).json()
        assert [job["id"] for job in page["jobs"]] == [made[6], made[4]]
        assert [job["id"] for job in admin.get(page["next"]).json()["jobs"]] == [made[2]]


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"limit": 0}, "limit"),
        ({"limit": 501}, "limit"),
        ({"state": "done"}, "state"),
        ({"before": SOMEWHERE}, "before"),
        ({"before": "x" * 37}, "before"),
        ({"colour": "red"}, "colour"),
    ],
    ids=str,
)
def test_lists_that_cannot_be_asked_for(admin, query, field):
    answer = admin.get(ADDRESS, params=query)

    assert (answer.status_code, slug_of(answer)) == (422, "invalid-input")
    assert [each["field"] for each in answer.json()["errors"]] == [field]


@pytest.mark.parametrize("job_id", [SOMEWHERE, "x", "0" * 5000, "..%2f..%2fetc", "%00", SOMEWHERE.upper()])
@pytest.mark.parametrize(("method", "below"), [("GET", ""), ("GET", "/events"), ("GET", "/logs"), ("POST", "/cancel")])
def test_a_job_that_is_not_there_is_not_found(admin, job_id, method, below):
    answer = admin.request(method, f"{ADDRESS}/{job_id}{below}")

    assert answer.status_code == 404
    assert slug_of(answer) in ("job-not-found", "not-found")


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("POST", ""),
        ("GET", ""),
        *(("GET", f"/{SOMEWHERE}{below}") for below in ("", "/events", "/logs")),
        ("POST", f"/{SOMEWHERE}/cancel"),
    ],
)
def test_nothing_is_told_without_the_token(admin, method, path):
    answer = admin.request(method, f"{ADDRESS}{path}", headers={"Authorization": "Basic d3Jvbmc="})

    assert (answer.status_code, slug_of(answer)) == (401, "unauthorized")


def test_cancelling_ends_a_job_once(admin):
    job = submit(admin)
    cancelled = admin.post(job["links"]["cancel"])
    again = admin.post(job["links"]["cancel"])

    assert (cancelled.status_code, cancelled.json()["state"]) == (202, "cancelled")
    assert cancelled.json()["links"]["cancel"] is None
    assert (again.status_code, slug_of(again)) == (409, "job-ended")
    assert admin.get(job["links"]["self"]).json()["state"] == "cancelled"


@pytest.mark.slow
def test_a_full_queue_says_when_to_come_back(tmp_path):
    with admin_client(job_store(tmp_path), max_queued_jobs=2) as admin:
        first, second = submit(admin), submit(admin, key="second")
        refused = admin.post(ADDRESS, json=ASKED)
        assert (refused.status_code, slug_of(refused)) == (429, "queue-full")
        assert int(refused.headers["retry-after"]) >= 1
        assert set(ids(admin)) == {first["id"], second["id"]}

        assert submit(admin, key="second")["id"] == second["id"]  # what is known is no newcomer
        admin.post(first["links"]["cancel"])
        assert admin.post(ADDRESS, json=ASKED).status_code == 202


@pytest.mark.slow
def test_a_database_that_is_down_is_a_503_and_predictions_go_on(tmp_path, question):
    with socket.create_server(("127.0.0.1", 0)) as silent:  # takes connections and says nothing
        port = silent.getsockname()[1]
        url = f"postgresql://somebody:pass-word@127.0.0.1:{port}/jobs"
        with (
            admin_client(job_store(tmp_path), jobs_database_url=url) as admin,
            ThreadPoolExecutor(8) as pool,
            fair_clock() as clock,
        ):
            began = clock()
            asked = [pool.submit(admin.get, ADDRESS) for _ in range(6)]
            asked += [
                pool.submit(admin.post, ADDRESS, json=ASKED),
                pool.submit(admin.get, f"{ADDRESS}/{SOMEWHERE}/events"),
            ]
            slowest = 0.0
            while not all(each.done() for each in asked):
                start = clock()
                assert admin.get("/v1/predictions", params=question).status_code == 200
                slowest = max(slowest, clock() - start)
                time.sleep(0.05)
            answers = [each.result() for each in asked]
            took = clock() - began

    for answer in answers:
        asked_for_more = answer.request.method == "POST"  # which is not even tried without the audit log
        slug = "audit-unavailable" if asked_for_more else "jobs-unavailable"
        assert (answer.status_code, slug_of(answer)) == (503, slug), answer.text
        assert int(answer.headers["retry-after"]) >= 1
        assert "pass-word" not in answer.text
        assert str(port) not in answer.text
    assert slowest < 1.0
    assert took < 8


@pytest.mark.slow
def test_a_retry_finds_its_job_also_when_the_dataset_is_gone_meanwhile(tmp_path):
    with admin_client(job_store(tmp_path)) as admin:
        job = submit(admin, key="lost-answer")
        admin.post(job["links"]["cancel"])
        (dataset,) = job["request"]["datasets"]
        assert admin.delete(f"/v1/admin/datasets/{dataset}").status_code == 204
        assert submit(admin, key="lost-answer")["id"] == job["id"]
        other = admin.post(ADDRESS, json=ASKED | {"seed": 8}, headers={"Idempotency-Key": "lost-answer"})
        assert (other.status_code, other.json()["errors"][0]["field"]) == (422, "datasets")


@pytest.mark.slow
def test_what_was_queued_survives_a_restart(tmp_path):
    store = job_store(tmp_path)
    with admin_client(store) as admin:
        job = submit(admin, key="once")
    with admin_client(store) as admin:
        assert admin.get(f"{ADDRESS}/{job['id']}").json() == job
        assert submit(admin, key="once")["id"] == job["id"]


def test_the_token_is_needed_even_where_the_body_is_wrong(admin):
    answer = admin.post(ADDRESS, content=b"{", headers={"Authorization": "", "Content-Type": "application/json"})

    assert answer.status_code == 401
    assert HEADERS["Authorization"] not in answer.text
