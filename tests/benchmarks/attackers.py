"""The clients of `attacks`: as many as wanted, and none of them polite."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

import uvloop

from tests.benchmarks.processes import HOST, Running


class Impatient(asyncio.Protocol):
    """Asks, and asks again as soon as it has an answer, whatever that says. Counts answers by their status."""

    def __init__(self, request: bytes, counts: Counter[int]) -> None:
        self._request, self._counts = request, counts
        self._left = 0  # bytes of the answer that are still to come
        self._head = b""

    def connection_made(self, transport: Any) -> None:
        """Begins."""
        self._transport = transport
        transport.write(self._request)

    def data_received(self, data: bytes) -> None:
        """Looks at heads only, for bodies have a megabyte."""
        if self._left:
            self._left -= len(data)
        else:
            head, end, body = (self._head + data).partition(b"\r\n\r\n")
            if not end:
                self._head = head
                return
            self._head, self._status = b"", int(head[9:12])
            lengths = (line[15:] for line in head.lower().split(b"\r\n") if line.startswith(b"content-length:"))
            self._left = int(next(lengths)) - len(body)
        if self._left <= 0:
            self._left = 0
            self._counts[self._status] += 1
            self._transport.write(self._request)


async def _storm(port: int, clients: int, seconds: float, path: str) -> Counter[int]:
    loop, counts = asyncio.get_running_loop(), Counter[int]()
    request = f"GET {path} HTTP/1.1\r\nHost: {HOST}\r\nAccept: application/json\r\n\r\n".encode()
    made = [await loop.create_connection(lambda: Impatient(request, counts), HOST, port) for _ in range(clients)]
    begun = time.monotonic()
    while counts.total() < clients and time.monotonic() < begun + 20:  # until then the line is still being made
        await asyncio.sleep(0.1)
    counts.clear()
    await asyncio.sleep(seconds)
    found = counts.copy()
    for transport, _ in made:
        transport.abort()
    return found


def storm(server: Running, clients: int, seconds: float, path: str) -> Counter[int]:
    """How many answers of each status came in so many seconds."""
    return uvloop.run(_storm(server.port, clients, seconds, path))


def asked(server: Running, path: str, timeout_s: float = 30.0) -> tuple[int, float]:
    """Status and time, s, of a request on a connection of its own; status 0 where none came."""
    began = time.perf_counter()
    with suppress(OSError, ValueError), socket.create_connection((HOST, server.port), timeout_s) as connection:
        connection.settimeout(timeout_s)
        connection.sendall(f"GET {path} HTTP/1.1\r\nHost: {HOST}\r\nConnection: close\r\n\r\n".encode())
        return int(connection.recv(4096)[9:12]), time.perf_counter() - began
    return 0, time.perf_counter() - began


@contextmanager
def silent(server: Running, count: int) -> Iterator[list[socket.socket]]:
    """So many connections on which nothing is sent."""
    with ExitStack() as stack:
        yield [stack.enter_context(socket.create_connection((HOST, server.port), 10)) for _ in range(count)]


def large_batch() -> bytes:
    """A request for as many numbers as there may be: a thousand scenarios, a million points, eleven columns."""
    scenarios = [{"slope_deg": 20, "mass_kg": 430, "torque_nm": 60, "horizon_s": 10}] * 1000
    sent = {"scenarios": scenarios, "dt_s": 0.0101, "include": ["prior", "band", "speed", "wheel_speed"]}
    return post("/v1/predictions/batch", sent)


def post(path: str, sent: object) -> bytes:
    """A request, as bytes."""
    body = json.dumps(sent).encode()
    head = f"POST {path} HTTP/1.1\r\nHost: {HOST}\r\nConnection: close\r\nContent-Type: application/json\r\n"
    return f"{head}Content-Length: {len(body)}\r\n\r\n".encode() + body


def answers(server: Running, request: bytes, clients: int, timeout_s: float) -> list[tuple[int, int]]:
    """Of each of so many clients at once: the status of the answer, and how many bytes of it came."""
    found: list[tuple[int, int]] = []

    def one() -> None:
        status, size = 0, 0
        with suppress(OSError, ValueError), socket.create_connection((HOST, server.port), timeout_s) as connection:
            connection.sendall(request)
            connection.settimeout(timeout_s)
            while piece := connection.recv(1 << 20):
                status = status or int(piece[9:12])
                size += len(piece)
        found.append((status, size))

    at_once(one, clients)
    return found


def at_once(call: Callable[[], object], count: int) -> None:
    """Calls it on so many threads, and waits for all."""
    threads = [threading.Thread(target=call, daemon=True) for _ in range(count)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()


@contextmanager
def most_memory(server: Running) -> Iterator[Callable[[], float]]:
    """A function that says how much memory the server had at most since the block began, MiB."""
    most, over = [server.resident_mib()], threading.Event()

    def watch() -> None:
        while not over.wait(0.02):
            most[0] = max(most[0], server.resident_mib())

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield lambda: most[0]
    finally:
        over.set()
        watcher.join()


def worst(found: Sequence[tuple[int, float]]) -> float:
    """The longest of the times."""
    return max(took for _, took in found)
