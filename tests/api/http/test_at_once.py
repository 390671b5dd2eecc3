"""Answers that wait for nothing are made where the connection reads: the same ones as through all middlewares."""

from __future__ import annotations

import socket
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from structlog.testing import capture_logs

from service.settings import Settings
from tests.api.conftest import serving
from tests.api.http.test_lanes import CASES

OWN = {"date", "x-request-id", "connection"}
QUESTION = "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60"
GETS = {name: path for name, (method, path, _) in CASES.items() if method == "GET"}


def taken(running, monkeypatch):
    """Which paths were answered at once."""
    ways, found = running.server._connections, []
    ask = ways.at_once

    def noted(scope):
        answer = ask(scope)
        found.append(answer is not None)
        return answer

    monkeypatch.setattr(ways, "at_once", noted)
    return found


@pytest.mark.parametrize("path", GETS.values(), ids=GETS)
@pytest.mark.parametrize(
    "headers",
    [{}, {"Accept-Encoding": "gzip"}, {"Range": "bytes=0-9", "Accept-Encoding": "identity"}, {"If-None-Match": "*"}],
)
def test_both_ways_answer_the_same(shipped, monkeypatch, path, headers):
    """A connection that ends with its answer goes through the middlewares."""
    found = taken(shipped, monkeypatch)
    here = shipped.client.get(path, headers=headers)
    there = shipped.client.get(path, headers={**headers, "Connection": "close"})

    assert found == ["nobody" not in path]  # whom it knows only the store can tell
    assert here.status_code == there.status_code
    assert here.content == there.content or headers.get("Accept-Encoding") == "gzip"
    assert here.text == there.text
    for name in {*here.headers, *there.headers} - OWN:
        assert here.headers.get(name) == there.headers.get(name), name


@pytest.mark.parametrize(
    ("method", "path", "headers", "body"),
    [
        ("HEAD", QUESTION, {}, None),
        ("GET", QUESTION, {}, b"{}"),
        ("GET", QUESTION + "&dt_s=0.005", {}, None),
        ("GET", QUESTION + "&format=svg", {}, None),
        ("GET", "/health/live", {}, None),
    ],
    ids=["without its body", "with a body", "many points", "a picture", "another address"],
)
def test_others_go_through_the_middlewares(shipped, monkeypatch, method, path, headers, body):
    found = taken(shipped, monkeypatch)
    assert shipped.client.request(method, path, headers=headers, content=body).status_code == 200
    assert found == [False]


@pytest.mark.parametrize(
    ("settings", "status"),
    [
        ({"require_token": True, "admin_token": "a" * 40, "start_worker": False}, 401),
        ({"cors_origins": ("https://a.example",)}, 200),
        ({"root_path": "/twin"}, 200),
    ],
    ids=["a token is needed", "pages of others", "a prefix"],
)
def test_settings_that_ask_more_of_each_request_are_kept(monkeypatch, settings, status):
    with serving(Path(Settings().store_url), **settings) as running:
        running.wait_ready()
        found = taken(running, monkeypatch)
        assert running.client.get(QUESTION).status_code == status
        assert found == [False]


def test_requests_sent_ahead_are_answered_in_their_order(shipped):
    """Those that wait and those that do not, mixed, in one piece."""
    asked = [(slope, ("", "&format=svg", "&dt_s=0.004")[slope % 3]) for slope in range(24)]
    paths = [f"/v1/predictions?slope_deg={slope}&mass_kg=430&torque_nm=60{more}" for slope, more in asked]
    alone = [shipped.client.get(path).content for path in paths]
    lines = [f"GET {path} HTTP/1.1\r\nHost: a\r\nX-Request-ID: n{at}\r\n" for at, path in enumerate(paths)]
    lines[-1] += "Connection: close\r\n"
    parts = urlsplit(shipped.url)
    with socket.create_connection((parts.hostname, parts.port), timeout=20) as connection:
        connection.sendall("\r\n".join([*lines, ""]).encode())
        received = b"".join(iter(lambda: connection.recv(1 << 16), b""))

    for at, body in enumerate(alone):
        head, _, received = received.partition(b"\r\n\r\n")
        assert f"x-request-id: n{at}".encode() in head
        size = int(head.lower().split(b"content-length: ")[1].split(b"\r\n")[0])
        assert received[:size] == body
        received = received[size:]
    assert not received


def test_an_error_that_nobody_foresaw_is_answered_and_logged(shipped, monkeypatch):
    monkeypatch.setattr("service.api.v1.predictions.written", lambda *_: 1 / 0)
    with capture_logs() as lines:
        answer = shipped.client.get(QUESTION)
    assert answer.status_code == 500
    assert answer.json()["type"].endswith("internal")
    assert [line["event"] for line in lines] == ["a request failed"]
    assert shipped.client.get("/health/live").status_code == 200
