"""Who guesses is slowed, and who it is stands in log and metrics."""

from __future__ import annotations

import json
import time

from tests.api.http.test_body_limit import exchange
from tests.api.identities.conftest import AUDIT, bearer, scraped
from tests.api.v1.test_aliases import CHAMPION


def test_wrong_tokens_are_slowed_and_the_right_one_never(named, give):
    ada = give("ada", "admin")
    wrong = [named.client.get(AUDIT, headers=bearer(f"guess {number}")) for number in range(8)]

    assert [answer.status_code for answer in wrong] == [401] * 5 + [429] * 3
    assert wrong[-1].json()["type"] == "urn:rover-twin:problem:too-many-attempts"
    assert 1 <= int(wrong[-1].headers["retry-after"]) <= 60
    assert named.client.get(AUDIT, headers=ada).status_code == 200
    assert named.client.get(AUDIT).status_code == 401  # sent none: that is no guess
    assert scraped(named.client, "failed_logins_total", reason="wrong") == 5
    assert scraped(named.client, "failed_logins_total", reason="slowed") == 3


def test_guesses_at_open_addresses_count_as_well(named):
    for _ in range(6):
        named.client.get("/health/ready", headers=bearer("a guess"))

    assert named.client.get(AUDIT, headers=bearer("a guess")).status_code == 429


def test_how_wrong_tokens_are_slowed_is_a_setting(serve, file):
    service = serve(tokens_file=file, start_worker=False, failed_logins_free=2, failed_logins_wait_s=1)

    answers = [service.client.get(AUDIT, headers=bearer("guess")) for _ in range(12)]
    assert [answer.status_code for answer in answers[:3]] == [401, 401, 429]
    assert {answer.headers.get("retry-after") for answer in answers[2:]} <= {"1", None}


def test_lines_of_requests_have_client_and_route_also_of_refused_ones(serve, give, file, lines, store, publish):
    publish(store)
    service = serve(tokens_file=file, start_worker=False, trusted_proxies=("127.0.0.1",))
    give("ada", "admin")
    time.sleep(0.2)
    behind = {"X-Forwarded-For": "203.0.113.9, 198.51.100.7"}

    service.client.get("/v1/models", headers=behind)
    service.client.get("/v1/admin/datasets/secret-name?secret=word", headers=behind)
    for _ in range(6):
        service.client.put(CHAMPION, headers=behind | bearer("secret-guess"))
    service.client.post("/v1/predictions", content=b"x" * 70_000, headers=behind)
    exchange(
        service, b"GET / HTTP/1.1\r\nHost: x\r\nX-Forwarded-For: 198.51.100.7\r\n" + b"a: secret\r\n" * 200 + b"\r\n"
    )
    exchange(service, b"secret nonsense\r\n\r\n")
    time.sleep(0.2)

    told = [(each["method"], each["route"], each["status"], each["client"]) for each in lines]
    client = "198.51.100.7"
    assert ("GET", "/v1/models", 200, client) in told
    assert ("GET", "/v1/admin/datasets/{dataset}", 401, client) in told
    assert told.count(("PUT", "/v1/models/{name}/aliases/{alias}", 401, client)) == 5
    assert ("PUT", "/v1/models/{name}/aliases/{alias}", 429, client) in told
    assert ("POST", "/v1/predictions", 413, client) in told
    assert ("GET", "no route", 431, client) in told
    assert ("?", "no route", 400, "127.0.0.1") in told
    assert "secret" not in json.dumps(lines)


def test_an_address_that_a_stranger_claims_is_not_believed(named, give, lines):
    behind = [{"X-Forwarded-For": f"198.51.100.{number}"} for number in range(8)]

    answers = [named.client.get(AUDIT, headers=bearer("guess") | each).status_code for each in behind]

    assert answers == [401] * 5 + [429] * 3
    assert {each["client"] for each in lines} == {"127.0.0.1"}
