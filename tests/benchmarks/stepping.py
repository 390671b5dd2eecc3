"""How fast rovers are moved on step by step: `python -m tests.benchmarks.stepping [--seconds 60]`.

The server has one processor, one worker and one thread; the client, which speaks the protocols itself, the other one.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass

import pyarrow as pa

from tests.benchmarks.machine import CLIENT_CPU, described, load_note
from tests.benchmarks.processes import HOST, Running, service
from tests.benchmarks.report import Bar, bars_table, write_part

_ARROW = "application/vnd.apache.arrow.stream"
_KEY = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
_UPGRADE = f"GET /v1/live HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n{_KEY}\r\n".encode()
_TOLD = {"slope_deg": 18.5, "torque_nm": 60.0, "dt_s": 0.02}
_PING, _PONG = 0x89, 0x8A
MANY, CONNECTIONS, RATE_HZ = 1000, 100, 50.0


@dataclass(frozen=True, slots=True)
class Times:
    """Milliseconds of many answers, and of the server's processor for each."""

    values: list[float]
    cpu_ms: float

    @property
    def p50(self) -> float:
        """The median."""
        return statistics.median(self.values)

    @property
    def p99(self) -> float:
        """99 of a hundred were no longer."""
        return statistics.quantiles(self.values, n=100)[-1]


def begin(name: str) -> dict[str, object]:
    """A rover's first step: its first second."""
    return {"id": name, "start": {"mass_kg": 430.0}, **_TOLD, "dt_s": 1.0}


def framed(content: bytes) -> bytes:
    """A masked frame of bytes; the mask is zero."""
    length = len(content)
    size = bytes([0x80 | length]) if length < 126 else bytes([0x80 | 126]) + length.to_bytes(2, "big")
    return b"\x82" + size + bytes(4) + content


def message(**told: object) -> bytes:
    """One rover's step as a frame."""
    return framed(json.dumps({"rovers": [told]}).encode())


class Client:
    """A connection that asks and waits."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection((HOST, port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer = bytearray(1 << 22)

    def upgraded(self) -> Client:
        """The same, as a WebSocket."""
        self._socket.sendall(_UPGRADE)
        assert b" 101 " in self._socket.recv(4096)
        return self

    def post(self, body: bytes, kind: str = "application/json", query: str = "") -> bytes:
        """The body of the answer."""
        head = (
            f"POST /v1/steps{query} HTTP/1.1\r\nHost: x\r\nContent-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        self._socket.sendall(head.encode() + body)
        got, whole, start = 0, 1 << 60, 0
        while got < whole:
            got += self._socket.recv_into(memoryview(self._buffer)[got:])
            if not start and (end := self._buffer.find(b"\r\n\r\n", 0, got)) >= 0:
                start = end + 4
                header = bytes(self._buffer[:start]).lower()
                assert b" 200 " in header[:20], header
                whole = start + int(header.split(b"content-length: ")[1].split(b"\r\n")[0])
        return bytes(self._buffer[start:got])

    def tell(self, frame: bytes) -> bytes:
        """What is answered to one frame."""
        self._socket.sendall(frame)
        got = self._socket.recv_into(self._buffer)
        while got < (whole := _frame_bytes(self._buffer, got)):
            got += self._socket.recv_into(memoryview(self._buffer)[got:])
        return bytes(self._buffer[4:whole])


def _frame_bytes(buffer: bytearray, got: int) -> int:
    if got < 4:
        return 4
    return 2 + buffer[1] if buffer[1] < 126 else 4 + int.from_bytes(buffer[2:4], "big")


def timed(server: Running, call: Callable[[], object], repeats: int, warm: int = 50) -> Times:
    """Of each call."""
    for _ in range(warm):
        call()
    taken, cpu = [], server.cpu_ms()
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        taken.append(1e3 * (time.perf_counter() - began))
    return Times(taken, (server.cpu_ms() - cpu) / repeats)


def one_over_http(server: Running, repeats: int) -> Times:
    """One rover, whose state travels."""
    client = Client(server.port)
    state = json.loads(client.post(json.dumps({"rovers": [begin("a")]}).encode()))["rovers"][0]["state"]
    body = json.dumps({"rovers": [{"id": "a", "state": state, **_TOLD}]}).encode()
    return timed(server, lambda: client.post(body), repeats)


def one_over_a_connection(server: Running, repeats: int) -> Times:
    """One rover, kept by the server."""
    client = Client(server.port).upgraded()
    client.tell(message(**begin("a")))
    frame = message(id="a", **_TOLD)
    return timed(server, lambda: client.tell(frame), repeats)


def many(server: Running, repeats: int) -> tuple[Times, Times]:
    """A thousand rovers in one request, JSON and Arrow."""
    client = Client(server.port)
    answer = json.loads(client.post(json.dumps({"rovers": [begin(f"r{n}") for n in range(MANY)]}).encode()))
    states = [each["state"] for each in answer["rovers"]]
    rovers = [{"id": f"r{n}", "state": state, **_TOLD} for n, state in enumerate(states)]
    body = json.dumps({"rovers": rovers}).encode()
    first = client.post(body, query="?format=arrow")
    found = pa.ipc.open_stream(first).read_all()
    columns = {"id": found["id"], "state": found["state"]}
    table = pa.table({**columns, **{name: pa.array([value] * MANY, pa.float64()) for name, value in _TOLD.items()}})
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, table.schema) as stream:
        stream.write_table(table)
    arrow = sink.getvalue().to_pybytes()
    json_times = timed(server, lambda: client.post(body), repeats, 5)
    return json_times, timed(server, lambda: client.post(arrow, _ARROW, "?format=arrow"), repeats, 5)


@dataclass(slots=True)
class Loops:
    """What control loops of many connections saw."""

    steps: int = 0
    missed: int = 0
    cpu_share: float = 0.0


class _Loop(asyncio.Protocol):
    """One rover's loop: a step every period; an answer that is not there by the next one is a missed deadline."""

    def __init__(self, seen: Loops, first: bytes, frame: bytes) -> None:
        self._seen, self._first, self._frame, self._waits, self._open = seen, first, frame, False, False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = transport
        transport.write(_UPGRADE)  # type: ignore[attr-defined]

    def data_received(self, data: bytes) -> None:
        if not self._open:
            assert b" 101 " in data
            self._open, self._waits = True, True
            self.transport.write(self._first)  # type: ignore[attr-defined]
            return
        at = 0
        while at < len(data):
            end = at + _frame_bytes(bytearray(data[at : at + 4]), len(data) - at)
            if data[at] == _PING:  # who does not answer is dropped after 40 s
                content = data[at + 2 : end]
                pong = bytes([_PONG, 0x80 | len(content)]) + bytes(4) + content
                self.transport.write(pong)  # type: ignore[attr-defined]
            else:
                self._waits = False
            at = end

    def tick(self) -> None:
        """Time for the next step."""
        self._seen.steps += 1
        if self._waits:
            self._seen.missed += 1
            return
        self._waits = True
        self.transport.write(self._frame)  # type: ignore[attr-defined]


async def loops(server: Running, seconds: float) -> Loops:
    """100 rovers at 50 Hz, each over a connection of its own, evenly staggered."""
    loop, seen = asyncio.get_running_loop(), Loops()
    frame = message(id="a", **_TOLD)
    protocols = []
    for _ in range(CONNECTIONS):
        _, protocol = await loop.create_connection(lambda: _Loop(seen, message(**begin("a")), frame), HOST, server.port)
        protocols.append(protocol)
    await asyncio.sleep(1.0)
    gap, count = 1.0 / (RATE_HZ * CONNECTIONS), round(seconds * RATE_HZ)
    cpu, began = server.cpu_ms(), loop.time()
    for number in range(count * CONNECTIONS):
        wait = began + number * gap - loop.time()
        await asyncio.sleep(max(wait, 0.0))
        protocols[number % CONNECTIONS].tick()
    seen.cpu_share = (server.cpu_ms() - cpu) / (1e3 * (loop.time() - began))
    return seen


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="of the control loops")
    parser.add_argument("--repeats", type=int, default=5000)
    parser.add_argument("--page", action="store_true", help="keep the numbers in docs/performance.md")
    asked = parser.parse_args()
    os.sched_setaffinity(0, {CLIENT_CPU})
    before = os.getloadavg()
    with service(settings={"LIVE_IDLE_S": "600"}) as server:
        live, http = one_over_a_connection(server, asked.repeats), one_over_http(server, asked.repeats)
        in_json, in_arrow = many(server, max(20, asked.repeats // 50))
        import uvloop

        seen = uvloop.run(loops(server, asked.seconds))
    bars = [
        Bar("one rover over a connection, p50, ms", live.p50, 0.35),
        Bar("one rover over a connection, p99, ms", live.p99, 2.0),
        Bar("one rover over HTTP, p50, ms", http.p50, 0.8),
        Bar(f"{MANY} rovers in one request, JSON, p50, ms", in_json.p50, 20.0),
        Bar(f"{MANY} rovers in one request, Arrow, p50, ms", in_arrow.p50, 8.0),
        Bar(f"missed deadlines of {CONNECTIONS} loops at {RATE_HZ:g} Hz, %", 100 * seen.missed / seen.steps, 0.1),
    ]
    each = ", ".join(
        f"{name} {times.cpu_ms:.3g} ms"
        for name, times in (("a connection", live), ("HTTP", http), ("JSON", in_json), ("Arrow", in_arrow))
    )
    share = f"Processor time of the server for each answer: {each}. "
    share += f"{seen.steps:,} steps in {asked.seconds:g} s took {100 * seen.cpu_share:.0f} % of one processor."
    where = f"`python -m tests.benchmarks.stepping`. {described()} {load_note(before)}"
    text = f"## Steps\n\n{where}\n\n{bars_table(bars)}\n\n{share}"
    print(f"\n{text}")
    if asked.page:
        write_part("stepping", text)


if __name__ == "__main__":
    main()
