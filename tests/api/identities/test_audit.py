"""The record of what tokens did, and how it is read."""

from __future__ import annotations

import pytest

from tests.api.conftest import ADMIN, TOKEN
from tests.api.identities.conftest import AUDIT, CHANGES, READABLE
from tests.api.v1.test_aliases import CHAMPION


def test_the_record_of_a_move_and_of_a_job_has_the_tokens_name(named, give):
    ada = give("ada", "admin")

    moved = named.client.put(CHAMPION, json={"version": 1, "reason": "first"}, headers=ada)

    assert moved.status_code == 201, moved.text
    assert moved.json()["actor"] == "ada"
    assert named.store.alias("viper-lunar", "champion").actor == "ada"


@pytest.mark.processes
def test_every_change_is_on_record_with_what_was_answered(named, give):
    ada = give("ada", "admin")
    asked = []
    for method, path in CHANGES:
        answer = named.client.request(method, f"{path}?name=x", headers=ada | {"X-Request-ID": f"r-{len(asked)}"})
        asked.append((method, path, answer.status_code, f"r-{len(asked)}"))
    for path in READABLE:
        named.client.get(path, headers=ada)

    answer = named.client.get(AUDIT, headers=ada)
    entries = answer.json()["entries"]

    assert answer.json()["next"] is None
    assert [(each["method"], each["path"], each["status"], each["request_id"]) for each in entries] == asked[::-1]
    assert {(each["actor"], each["client"]) for each in entries} == {("ada", "127.0.0.1")}
    assert {each["route"] for each in entries} >= {
        "/v1/admin/datasets/{dataset}",
        "/v1/models/{name}/aliases/{alias}",
        "/v2/repository/models/{name}/unload",
    }
    assert "Bearer" not in answer.text
    assert "name=x" not in answer.text


def test_the_audit_log_is_read_in_pages_by_actor_and_by_time(named, give):
    people = {name: give(name, "admin") for name in ("ada", "joe")}
    for number in range(7):
        named.client.post(f"{CHAMPION}/rollback", headers=people["joe" if number % 2 else "ada"])

    def pages(address):
        while address:
            page = named.client.get(address, headers=people["ada"]).json()
            assert len(page["entries"]) <= 2
            yield from page["entries"]
            address = page["next"]

    everything = list(pages(f"{AUDIT}?limit=2"))
    assert [each["actor"] for each in everything] == ["ada", "joe"] * 3 + ["ada"]
    assert [each["actor"] for each in pages(f"{AUDIT}?limit=2&actor=joe")] == ["joe"] * 3
    since = everything[3]["at"].replace("+", "%2B")
    assert [each["id"] for each in pages(f"{AUDIT}?limit=2&since={since}")][:4] == [
        each["id"] for each in everything[:4]
    ]
    assert list(pages(f"{AUDIT}?limit=2&since=2999-01-01T00:00:00Z")) == []
    for wrong in ("limit=0", "limit=201", "since=yesterday", "before=0", "nonsense=1", "actor=a&actor=b"):
        assert named.client.get(f"{AUDIT}?{wrong}", headers=people["ada"]).status_code == 422, wrong


def test_what_cannot_be_put_on_record_is_not_done(serve, store, publish, tmp_path):
    publish(store)
    (tmp_path / "in the way").write_text("")
    service = serve(
        admin_token=TOKEN, start_worker=False, jobs_database_url=f"sqlite:///{tmp_path / 'in the way' / 'jobs.sqlite'}"
    )

    refused = service.client.put(CHAMPION, json={"version": 1, "reason": "first"}, headers=ADMIN)
    read = service.client.get(AUDIT, headers=ADMIN)

    assert refused.status_code == read.status_code == 503
    assert refused.json()["type"] == "urn:rover-twin:problem:audit-unavailable"
    assert "in the way" not in refused.text
    assert int(refused.headers["retry-after"]) >= 1
    assert store.aliases("viper-lunar") == {}


@pytest.mark.parametrize(
    "query",
    [
        "since=0001-01-01T00:00:00%2B14:00",
        "until=9999-12-31T23:59:59-14:00",
        "since=0001-01-01T00:00:00",
        "until=9999-12-31T23:59:59",
    ],
)
def test_the_first_and_the_last_moment_there_is_select_everything(named, give, query):
    ada = give("ada", "admin")
    for _ in range(3):
        named.client.post(f"{CHAMPION}/rollback", headers=ada)

    first = named.client.get(f"{AUDIT}?limit=2&{query}", headers=ada)
    assert first.status_code == 200, first.text
    rest = named.client.get(first.json()["next"], headers=ada).json()
    assert [len(first.json()["entries"]), len(rest["entries"]), rest["next"]] == [2, 1, None]


@pytest.mark.parametrize(
    ("query", "field", "allowed"),
    [
        ("actor=%00", "actor", "the name of a token: 1 to 63 of A-Z a-z 0-9"),
        ("actor=ada%0A", "actor", "the name of a token"),
        ("before=9223372036854775808", "before", "a whole number from 1 to 9223372036854775807"),
    ],
)
def test_what_cannot_be_looked_for_names_what_can(named, give, query, field, allowed):
    answer = named.client.get(f"{AUDIT}?{query}", headers=give("ada", "admin"))

    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["field"] == field
    assert allowed in error["allowed"]


def test_a_row_says_what_the_call_was_about(named, give):
    ada = give("ada", "admin")
    versions = "/v1/admin/models/viper-lunar/versions"
    calls = [
        ("PUT", CHAMPION, {"version": 1, "reason": "a secret reason"}, "viper-lunar@champion -> 1"),
        ("POST", f"{versions}/2/archive", {"reason": "a secret reason"}, "viper-lunar@2"),
        ("PUT", CHAMPION, {"nonsense": "a secret reason"}, None),
    ]
    for method, path, body, _ in calls:
        named.client.request(method, path, json=body, headers=ada)

    answer = named.client.get(AUDIT, headers=ada)

    assert [each["subject"] for each in answer.json()["entries"]] == [said for *_, said in reversed(calls)]
    assert "secret" not in answer.text
