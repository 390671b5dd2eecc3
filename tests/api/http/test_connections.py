"""Clients that send nothing, too much, or do not read: each is cut off, and others are served all the while."""

from __future__ import annotations

import re
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from urllib.parse import urlsplit

import httpx
import orjson
import psutil
import pytest

QUICK = {"head_timeout_s": 1.0, "send_timeout_s": 1.0}


def connect(url: str) -> socket.socket:
    parts = urlsplit(url)
    return socket.create_connection((parts.hostname, parts.port), timeout=10)


@contextmanager
def silent(url: str, count: int) -> Iterator[list[socket.socket]]:
    with ExitStack() as stack:
        yield [stack.enter_context(connect(url)) for _ in range(count)]


def answer_of(connection: socket.socket) -> bytes:
    received = b""
    try:
        while piece := connection.recv(65536):
            received += piece
    except ConnectionResetError:
        pass
    return received


def one_answer(connection: socket.socket) -> bytes:
    """Of an address that answers with one small JSON object."""
    received = b""
    while not received.endswith(b"}"):
        piece = connection.recv(65536)
        assert piece, received
        received += piece
    return received


def ask(url: str, path: str = "/health/live") -> int:
    with httpx.Client(base_url=url, timeout=5, trust_env=False) as client:
        return client.get(path).status_code


def test_silent_connections_keep_nobody_out(serve: Any) -> None:
    running = serve(max_connections=32)
    with silent(running.url, 200):
        began = time.monotonic()
        assert ask(running.url) == 200
        assert ask(running.url, "/v1/models") == 200
        assert time.monotonic() - began < 5


def test_who_asks_ahead_and_leaves_is_no_error(own_process: Any, store: Any, publish: Any, move: Any) -> None:
    move(store, publish(store))
    client, process = own_process()
    url, asked = str(client.base_url), b"GET /v1/models HTTP/1.1\r\nHost: a\r\n\r\n"
    for _ in range(20):
        with connect(url) as connection:
            connection.sendall(asked * 3)
    assert client.get("/health/live").status_code == 200
    process.send_signal(signal.SIGTERM)

    assert "Exception" not in process.communicate(timeout=30)[1]


def test_health_is_answered_when_all_connections_are_busy(serve: Any) -> None:
    running = serve(max_connections=16)
    # a head that is done, and a body that is still to come: a request is being answered
    head = b"POST /v1/predictions HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\nContent-Length: 100\r\n\r\n"
    with silent(running.url, 16) as busy:
        for each in busy:
            each.sendall(head)
        time.sleep(0.5)
        assert ask(running.url) == 200
        assert ask(running.url, "/v1/models") == 503


def test_who_sends_nothing_is_cut_off(serve: Any) -> None:
    running = serve(**QUICK)
    with connect(running.url) as connection:
        connection.settimeout(10)
        assert answer_of(connection) == b""


def test_who_sends_a_head_slowly_is_told_so(serve: Any) -> None:
    running = serve(**QUICK)
    with connect(running.url) as connection:
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\nX-Slow: ")
        answer = answer_of(connection)
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"head-too-slow" in answer


def test_a_slow_start_is_no_offence(serve: Any) -> None:
    running = serve(head_timeout_s=5.0)
    with connect(running.url) as connection:
        for piece in (b"GET /health/live HTTP/1.1\r\n", b"Host: a\r\n", b"Connection: close\r\n", b"\r\n"):
            connection.sendall(piece)
            time.sleep(0.3)
        assert answer_of(connection).startswith(b"HTTP/1.1 200 ")


@pytest.mark.parametrize(
    "head",
    [
        b"X-Large: " + b"a" * 33_000 + b"\r\n",
        b"".join(b"X-Many-%d: a\r\n" % number for number in range(101)),
        b"".join(b"X-Several-%d: " % number + b"a" * 4000 + b"\r\n" for number in range(9)),
    ],
    ids=["one large header", "many headers", "several large headers"],
)
def test_a_head_that_is_too_large_is_a_problem(service: Any, head: bytes) -> None:
    with connect(service.url) as connection:
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\n" + head + b"\r\n")
        answer = answer_of(connection)
    assert answer.startswith(b"HTTP/1.1 431 "), answer[:200]
    assert b"application/problem+json" in answer
    assert b"head-too-large" in answer
    assert b"goes into the body of a POST" in answer


def test_a_head_within_the_limit_passes(service: Any) -> None:
    head = b"".join(b"X-%d: " % number + b"a" * 300 + b"\r\n" for number in range(95))
    with connect(service.url) as connection:
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\nConnection: close\r\n" + head + b"\r\n")
        assert answer_of(connection).startswith(b"HTTP/1.1 200 ")


def test_endless_headers_fill_no_memory(own_process: Any, store: Any, publish: Any, move: Any) -> None:
    move(store, publish(store))
    client, process = own_process()
    before = psutil.Process(process.pid).memory_info().rss
    with connect(str(client.base_url)) as connection:
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\n")
        sent = 0
        try:
            while sent < 60 << 20:
                connection.sendall(b"X-More: " + b"a" * 8000 + b"\r\n")
                sent += 8010
        except OSError:
            pass
    assert sent < 60 << 20
    assert psutil.Process(process.pid).memory_info().rss - before < 16 << 20
    assert client.get("/health/live").status_code == 200


def test_what_is_no_request_is_a_problem(service: Any) -> None:
    with connect(service.url) as connection:
        connection.sendall(b"\x16\x03\x01 hello\r\n\r\n")
        answer = answer_of(connection)
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert b"malformed-head" in answer


@pytest.mark.parametrize(("hosts", "told"), [([], b"no Host"), (["a", "a"], b"2 Host"), (["a", "b"], b"2 Host")])
def test_a_request_has_one_host(service: Any, hosts: list[str], told: bytes) -> None:
    with connect(service.url) as connection:
        lines = "".join(f"Host: {each}\r\n" for each in hosts)
        connection.sendall(f"GET /health/live HTTP/1.1\r\n{lines}\r\n".encode())
        answer = answer_of(connection)
    assert answer.startswith(b"HTTP/1.1 400 ")
    assert told in answer


GARBAGE = b"no request\r\n\r\n"
TWO_HOSTS = b"GET /health/live HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n"
LONG_HEAD = b"GET / HTTP/1.1\r\nHost: a\r\nX: %b\r\n\r\n" % (b"a" * 40_000)


def statuses(service: Any, sent: bytes) -> list[bytes]:
    with connect(service.url) as connection:
        connection.sendall(sent)
        return re.findall(rb"HTTP/1.1 (\d+) ", answer_of(connection))


@pytest.mark.parametrize(("broken", "status"), [(GARBAGE, b"400"), (TWO_HOSTS, b"400"), (LONG_HEAD, b"431")])
@pytest.mark.parametrize("before", [1, 2, 5])
def test_what_cannot_be_read_is_refused_after_the_answers_to_what_was_sent_before(
    service: Any, question: Any, broken: bytes, status: bytes, before: int
) -> None:
    body = orjson.dumps(question)
    head = b"POST /v1/predictions HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\n"
    post = head + b"Content-Length: %d\r\n\r\n%b" % (len(body), body)
    assert statuses(service, post * before + broken) == [b"200"] * before + [status]


@pytest.mark.parametrize("before", [0, 1, 3])
def test_a_request_whose_body_cannot_be_read_has_one_answer(service: Any, before: int) -> None:
    get = b"GET /v1/models HTTP/1.1\r\nHost: a\r\n\r\n"
    post = b"POST /v1/predictions HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\nthis is no chunk\r\n"
    assert statuses(service, get * before + post) == [b"200"] * before + [b"400"]


def test_who_does_not_read_is_cut_off(serve: Any, store: Any, publish: Any, move: Any) -> None:
    move(store, publish(store))
    running = serve(**QUICK)
    running.wait_ready()
    query = "slope_deg=20&mass_kg=430&torque_nm=60&horizon_s=600&dt_s=0.00601"
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        parts = urlsplit(running.url)
        connection.connect((parts.hostname, parts.port))
        connection.sendall(f"GET /v1/predictions?{query} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
        deadline = time.monotonic() + 20
        cut = 'rover_twin_connections_refused_total{reason="slow-reader"} 1.0'
        while cut not in running.get("/metrics").text and time.monotonic() < deadline:
            time.sleep(0.2)
        assert cut in running.get("/metrics").text


def test_who_reads_slowly_gets_everything(serve: Any, store: Any, publish: Any, move: Any) -> None:
    move(store, publish(store))
    running = serve(**QUICK)
    running.wait_ready()
    query = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 60, "horizon_s": 600, "dt_s": 0.02}
    with running.client.stream("GET", "/v1/predictions", params=query) as answer:
        received = 0
        for piece in answer.iter_raw(64 << 10):
            received += len(piece)
            time.sleep(0.1)
    assert received == int(answer.headers["content-length"])


def test_a_request_on_its_way_when_the_server_ends_is_answered(serve: Any) -> None:
    running = serve()
    with connect(running.url) as connection:
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\n\r\n")
        assert one_answer(connection).startswith(b"HTTP/1.1 200 ")
        running.server.should_exit = True
        time.sleep(0.4)
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\n\r\n")
        answer = answer_of(connection)
    assert answer.startswith(b"HTTP/1.1 200 ")
    assert b"connection: close" in answer.lower()


def test_while_it_drains_all_are_answered_and_told_to_go(serve: Any) -> None:
    running = serve(drain_s=30)
    ask_alive = b"GET /health/live HTTP/1.1\r\nHost: a\r\n\r\n"
    with connect(running.url) as kept:
        kept.sendall(ask_alive)
        assert b"connection: close" not in one_answer(kept).lower()
        running.server.handle_exit(signal.SIGTERM, None)
        time.sleep(1)
        for connection in (kept, connect(running.url)):
            with connection:
                connection.sendall(ask_alive)
                answer = answer_of(connection)
                assert answer.startswith(b"HTTP/1.1 200 ")
                assert b"connection: close" in answer.lower()


def test_a_connection_that_was_not_told_is_not_closed_under_a_request(
    serve: Any, store: Any, publish: Any, move: Any
) -> None:
    """Its answer has begun when the server ends, so it cannot say that it is the last one."""
    move(store, publish(store))
    running = serve()
    running.wait_ready()
    query = "slope_deg=20&mass_kg=430&torque_nm=60&horizon_s=600&dt_s=0.00601"
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        parts = urlsplit(running.url)
        connection.connect((parts.hostname, parts.port))
        connection.settimeout(20)
        connection.sendall(f"GET /v1/predictions?{query} HTTP/1.1\r\nHost: a\r\n\r\n".encode())
        head = b""
        while b"\r\n\r\n" not in head:
            head += connection.recv(1)
        assert b"connection: close" not in head.lower()
        size = next(int(line[15:]) for line in head.lower().splitlines() if line.startswith(b"content-length:"))
        running.server.should_exit = True
        time.sleep(0.5)
        while size:
            piece = connection.recv(min(size, 1 << 20))
            assert piece
            size -= len(piece)
        connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\n\r\n")
        assert answer_of(connection).startswith(b"HTTP/1.1 200 ")


def test_slow_readers_fill_no_memory(own_process: Any, store: Any, publish: Any, move: Any) -> None:
    """Forty clients ask for a batch of 150 MB each and read nothing of it."""
    move(store, publish(store))
    client, process = own_process(max_answer_bytes=64 << 20, send_timeout_s=30)
    scenarios = [{"slope_deg": 20, "mass_kg": 430, "torque_nm": 60, "horizon_s": 600}] * 1000
    body = orjson.dumps({"scenarios": scenarios, "dt_s": 0.61})
    head = "POST /v1/predictions/batch HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\n"
    head += f"Content-Length: {len(body)}\r\n\r\n"
    with silent(str(client.base_url), 40) as readers:
        for each in readers:
            each.sendall(head.encode() + body)
        most, deadline = 0, time.monotonic() + 20
        while time.monotonic() < deadline:
            most = max(most, psutil.Process(process.pid).memory_info().rss)
            assert client.get("/health/live").status_code == 200
            time.sleep(0.2)
    assert most < 1 << 30, most >> 20
