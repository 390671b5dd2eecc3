"""Tokens by name over HTTP: what each scope may, and files of tokens that change or break."""

from __future__ import annotations

import os
import time

import httpx
import pytest

from service.access.token_file import StoredToken, add, remove
from service.access.tokens import digest_of, new_token
from tests.api.conftest import PLAIN, QUESTION
from tests.api.identities.conftest import AUDIT, CHANGES, HEALTH, READABLE, bearer, scraped, taken_up
from tests.api.v1.test_aliases import CHAMPION


def test_who_may_read_may_change_nothing_and_sees_no_audit_log(named, give):
    reader = give("joe", "read")

    for path in READABLE:
        assert named.client.get(path, headers=reader).status_code == 200, path
    for method, path in [*CHANGES, ("GET", AUDIT), ("DELETE", "/v1/admin/no-such-thing")]:
        answer = named.client.request(method, path, headers=reader)
        assert answer.status_code == 403, path
        assert 'error="insufficient_scope"' in answer.headers["www-authenticate"]
        said = answer.json()
        assert "joe" in said.get("detail", said["error"])
        assert said.get("type", "insufficient-scope").endswith("insufficient-scope")
    assert named.client.get(AUDIT, headers=give("ada", "admin")).json()["entries"] == []
    assert scraped(named.client, "failed_logins_total", reason="scope") == len(CHANGES) + 2


def test_a_new_token_is_in_force_at_once_and_a_revoked_one_is_not(named, give, file):
    ada = give("ada", "admin")
    assert named.client.get(AUDIT, headers=ada).status_code == 200

    remove(file, "ada")
    taken_up(named)

    assert named.client.get(AUDIT, headers=ada).status_code == 401
    assert named.client.get(AUDIT, headers=give("ada", "admin")).status_code == 200


def test_a_file_that_breaks_is_told_to_those_with_a_token_and_to_metrics(named, give, file, publish, move):
    move(named.store, 1)
    named.wait_ready()
    ada = give("ada", "admin")
    assert named.client.get("/health/ready", headers=ada).json()["warnings"] == []
    assert scraped(named.client, "tokens_file_unusable") == 0

    file.write_text(file.read_text() + "not a line\n")
    for _ in range(400):
        if scraped(named.client, "tokens_file_unusable"):
            break
        time.sleep(0.05)

    ready = named.client.get("/health/ready", headers=ada)
    assert ready.status_code == 200
    assert "line 2" in ready.json()["warnings"][0]
    assert "warnings" not in named.get("/health/ready").json()
    assert scraped(named.client, "tokens_file_unusable") == 1


def test_with_a_token_for_everything_only_health_is_open(serve, file, give, store, publish, move):
    move(store, publish(store))
    reader = give("joe", "read")
    service = serve(tokens_file=file, require_token=True, start_worker=False)
    service.wait_ready()
    document = service.client.get("/openapi.json", headers=reader).json()

    for path, operations in document["paths"].items():
        address = path.replace("{name}", "viper-lunar").replace("{version}", "1").replace("{alias}", "champion")
        for method in operations:
            answer = service.client.request(method, address)
            if path in HEALTH:
                assert answer.status_code == 200, path
                continue
            assert answer.status_code == 401, path
            assert answer.headers["www-authenticate"].startswith("Bearer")
    for path in ("/docs", "/openapi.json", "/metrics", "/no-such-thing", "/page/no-such-file", "/v1/live"):
        assert service.get(path).status_code == 401, path
    assert service.get("/").status_code == 200  # the page, which asks for the token
    assert service.client.get("/v1/predictions", params=QUESTION, headers=reader).status_code == 200
    assert service.client.post("/v2/models/viper-lunar/infer", headers=reader, json={}).status_code == 400
    assert service.client.get("/metrics", headers=reader).status_code == 200


def test_several_tokens_in_one_request_are_refused(named, give):
    ada = give("ada", "admin")["Authorization"]
    twice = [("Authorization", ada), ("Authorization", "Bearer another")]

    for headers in (twice, twice[::-1], [twice[0]] * 2):
        answer = named.client.get(AUDIT, headers=headers)
        assert answer.status_code == 400
        assert answer.json()["type"].endswith("malformed-head")
        assert "Authorization" in answer.json()["detail"]
        assert named.client.post("/v2/repository/models/x/load", headers=headers).status_code == 400
        assert "failures" not in named.client.get("/health/ready", headers=headers).json()
    assert scraped(named.client, "failed_logins_total", reason="wrong") == 0


def test_a_file_that_becomes_a_pipe_hinders_nobody(named, give, file, move):
    move(named.store, 1)
    named.wait_ready()
    ada = give("ada", "admin")
    file.unlink()
    os.mkfifo(file)
    time.sleep(0.5)

    began = time.monotonic()
    assert named.get("/health/live").status_code == 200
    assert named.client.get(AUDIT, headers=ada).status_code == 200
    assert "no regular file" in named.client.get("/health/ready", headers=ada).json()["warnings"][0]
    assert time.monotonic() - began < 5
    assert scraped(named.client, "tokens_file_unusable") == 1


@pytest.mark.processes
def test_several_processes_take_up_a_new_token(own_process, store, publish, move, tmp_path):
    move(store, publish(store))
    file = tmp_path / "tokens"
    token = new_token()
    file.touch()
    client, process = own_process(workers=2, threads=1, tokens_file=file, start_worker="false")
    add(file, StoredToken("ada", "admin", digest_of(token.encode())))
    time.sleep(2.5)

    for number in range(12):  # each over a connection of its own: both processes get some
        with httpx.Client(base_url=client.base_url, timeout=30, headers=bearer(token), **PLAIN) as fresh:
            answer = fresh.put(CHAMPION.replace("champion", f"try-{number}"), json={"version": 1, "reason": "to see"})
            assert answer.status_code == 201, answer.text
    entries = httpx.get(f"{client.base_url}{AUDIT}", headers=bearer(token), **PLAIN).json()["entries"]
    assert [each["status"] for each in entries] == [201] * 12
    assert process.poll() is None
