"""Tokens by name over HTTP: scopes, who is on record, who is slowed, and what strangers are not told."""

from __future__ import annotations

import json
import logging
import os
import time

import httpx
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from service.access import tokens as tokens_module
from service.access.token_file import StoredToken, add, remove
from service.access.tokens import digest_of, new_token
from service.api.v1.live import REVOKED
from service.log import REQUESTS
from tests.api.conftest import ADMIN, PLAIN, QUESTION, TOKEN
from tests.api.http.test_body_limit import exchange
from tests.api.training import job_store, submit
from tests.api.v1.test_aliases import CHAMPION

AUDIT = "/v1/admin/audit"
HEALTH = ("/health/live", "/health/ready", "/v2/health/live", "/v2/health/ready")
READABLE = ("/v1/admin/datasets", "/v1/admin/training-jobs")
CHANGES = [
    ("POST", "/v1/admin/datasets"),
    ("DELETE", "/v1/admin/datasets/abcdef"),
    ("POST", "/v1/admin/training-jobs"),
    ("POST", "/v1/admin/training-jobs/0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10/cancel"),
    ("PUT", CHAMPION),
    ("POST", f"{CHAMPION}/rollback"),
    ("POST", "/v2/repository/models/viper-lunar/load"),
    ("POST", "/v2/repository/models/viper-lunar/unload"),
]


def bearer(token):
    return {"Authorization": f"Bearer {token}"}


@pytest.fixture
def file(tmp_path, monkeypatch):
    """An empty file of tokens, which the service looks at all the time."""
    monkeypatch.setattr(tokens_module, "_LOOK_S", 0.02)
    (tmp_path / "tokens").touch()
    return tmp_path / "tokens"


class Give:
    """Makes a token. Where there is a `service`, it is in force then."""

    def __init__(self, file):
        self.file = file
        self.service = None

    def __call__(self, name, scope):
        token = new_token()
        add(self.file, StoredToken(name, scope, digest_of(token.encode())))
        if self.service is not None:
            taken_up(self.service)
        return bearer(token)


def taken_up(service, headers=None):
    """Wait until the service has looked at its file of tokens once more; at those that it has read for sure."""
    changed = time.monotonic()
    while time.monotonic() < changed + 20:
        age_s = scraped(service.client, "tokens_file_confirmed_age_seconds", headers=headers or {})
        if time.monotonic() - age_s > changed + 0.1:  # what was under way while it changed
            return
        time.sleep(0.02)
    raise AssertionError("the service does not look at its tokens")


@pytest.fixture
def give(file):
    return Give(file)


@pytest.fixture
def named(serve, file, store, publish, give):
    """A service with a file of tokens, and three versions to move an alias to."""
    for coefficient in (0.1, 0.2, 0.3):
        publish(store, coefficient=coefficient)
    give.service = serve(tokens_file=file, start_worker=False)
    return give.service


@pytest.fixture
def lines():
    """What is said of requests while the test runs."""
    found = []
    handler = logging.Handler(logging.DEBUG)
    handler.emit = lambda record: found.append(record.msg)
    logger = logging.getLogger(REQUESTS)
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.DEBUG)
    yield found
    logger.removeHandler(handler)
    logger.setLevel(level)


def scraped(client, name, **labels):
    text = client.get("/metrics", headers=labels.pop("headers", {})).text
    wanted = ",".join(f'{key}="{value}"' for key, value in labels.items())
    place = f"rover_twin_{name}" + (f"{{{wanted}}}" if wanted else "")
    return next((float(line.split()[1]) for line in text.splitlines() if line.split()[0] == place), 0.0)


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


def test_the_record_of_a_move_and_of_a_job_has_the_tokens_name(named, give):
    ada = give("ada", "admin")

    moved = named.client.put(CHAMPION, json={"version": 1, "reason": "first"}, headers=ada)

    assert moved.status_code == 201, moved.text
    assert moved.json()["actor"] == "ada"
    assert named.store.alias("viper-lunar", "champion").actor == "ada"


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


def test_the_websocket_needs_the_token_too(serve, file, give, store, publish, move):
    move(store, publish(store))
    joe = give("joe", "read")
    service = serve(tokens_file=file, require_token=True, start_worker=False)
    address = service.url.replace("http", "ws") + "/v1/live"

    with pytest.raises(InvalidStatus) as caught:
        connect(address, proxy=None).close()
    assert caught.value.response.status_code == 401
    assert json.loads(caught.value.response.body)["type"].endswith("unauthorized")
    with connect(address, proxy=None, additional_headers=joe) as connection:
        connection.send("{}")
        assert connection.recv(timeout=10)


def talk(connection, *, busy):
    """Until it ends; a client that is not `busy` only listens."""
    for _ in range(2000):
        if busy:
            connection.send("{}")
        connection.recv(timeout=20)
        time.sleep(0.01)


@pytest.mark.parametrize("busy", [False, True], ids=["quiet", "busy"])
def test_a_websocket_whose_token_is_revoked_is_closed(serve, file, give, store, publish, move, busy):
    move(store, publish(store))
    joe, ada = give("joe", "read"), give("ada", "read")
    service = serve(tokens_file=file, require_token=True, start_worker=False)
    address = service.url.replace("http", "ws") + "/v1/live"

    with (
        connect(address, proxy=None, additional_headers=joe) as revoked,
        connect(address, proxy=None, additional_headers=ada) as other,
    ):
        remove(file, "joe")
        with pytest.raises(ConnectionClosed) as caught:
            talk(revoked, busy=busy)
        assert caught.value.rcvd.code == REVOKED
        assert "token" in caught.value.rcvd.reason
        other.send("{}")
        assert other.recv(timeout=10)
    ended = {"reason": "revoked", "headers": ada}
    assert scraped(service.client, "live_connections_ended_total", **ended) == 1


def test_without_a_token_for_everything_a_websocket_asks_for_none(named, publish, move):
    move(named.store, 1)
    named.wait_ready()
    with connect(named.url.replace("http", "ws") + "/v1/live", proxy=None) as connection:
        time.sleep(1.5)
        connection.send("{}")
        assert connection.recv(timeout=10)


def test_events_of_a_job_end_when_the_token_is_revoked(serve, tmp_path, file, give):
    job_store(tmp_path)
    joe, ada = give("joe", "read"), give("ada", "admin")
    service = serve(tokens_file=file, start_worker=False)
    service.client.headers.update(ada)
    address = submit(service.client)["links"]["events"]

    with service.client.stream("GET", address, headers=joe, timeout=20) as answer:
        events = answer.iter_lines()
        assert "retry" in next(events)
        remove(file, "joe")
        assert '"queued"' in "".join(events)  # and then it ends
    assert service.client.get(address, headers=joe).status_code == 401


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
