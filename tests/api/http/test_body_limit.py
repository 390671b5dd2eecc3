"""Bodies over the limit are turned away: by their announced length at once, else while they come in."""

from __future__ import annotations

import json
import socket

import pytest

LIMIT = 64 * 1024


def exchange(service, head: bytes, *chunks: bytes, wait_s: float = 10) -> bytes:
    """Send raw bytes, then read until the server closes or has answered."""
    host, port = service.url.removeprefix("http://").split(":")
    received = b""
    with socket.create_connection((host, int(port)), timeout=wait_s) as connection:
        try:
            connection.sendall(head)
            for chunk in chunks:
                connection.sendall(chunk)
        except (BrokenPipeError, ConnectionResetError):
            pass
        try:
            while part := connection.recv(65536):
                received += part
        except (ConnectionResetError, TimeoutError):
            pass
    return received


def head(*lines: str, method: str = "POST") -> bytes:
    fields = ["Host: x", "Content-Type: application/json", "Connection: close", *lines]
    return (f"{method} /v1/predictions HTTP/1.1\r\n" + "\r\n".join(fields) + "\r\n\r\n").encode()


@pytest.mark.slow
def test_an_announced_length_is_refused_before_the_body_is_sent(service):
    for length in (LIMIT + 1, 10**12, 10**17):
        answer = exchange(service, head(f"Content-Length: {length}"))
        assert answer.startswith(b"HTTP/1.1 413"), answer
        assert b"urn:rover-twin:problem:body-too-large" in answer
        assert b"65536 bytes" in answer


@pytest.mark.slow
def test_a_body_without_length_is_counted_while_it_comes_in(service):
    chunk = b"8000\r\n" + b" " * 0x8000 + b"\r\n"

    answer = exchange(service, head("Transfer-Encoding: chunked"), chunk, chunk, chunk, chunk)

    assert answer.startswith(b"HTTP/1.1 413"), answer
    assert b"urn:rover-twin:problem:body-too-large" in answer


@pytest.mark.slow
def test_a_get_with_a_large_body_is_refused_too(service):
    answer = exchange(service, head(f"Content-Length: {LIMIT + 1}", method="GET"))

    assert answer.startswith(b"HTTP/1.1 413"), answer


def test_a_body_of_exactly_the_limit_is_read(service, question):
    body = json.dumps(question).encode().ljust(LIMIT)

    fits = service.client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})
    over = service.client.post("/v1/predictions", content=body + b" ", headers={"content-type": "application/json"})

    assert (fits.status_code, over.status_code) == (200, 413)
