"""A load generator for machines without wrk: `python -m tests.benchmarks.load_client PORT CONNECTIONS SECONDS FILE`

Closed loop as wrk: each connection asks again once it has its answer. Takes several times the processor time of wrk,
so where server and client are equally fast it measures itself. Prints the line that `load.lua` prints.
"""

from __future__ import annotations

import asyncio
import statistics
import sys
import time
from itertools import cycle
from pathlib import Path
from typing import Any

import httptools
import uvloop

from tests.benchmarks.client import Question
from tests.benchmarks.processes import HOST


class Asker(asyncio.Protocol):
    """One connection, asking until `until`."""

    def __init__(self, requests: Any, until: float, times_s: list[float], done: asyncio.Future[None]) -> None:
        self._requests, self._until, self._times_s, self._done = requests, until, times_s, done
        self._parser = httptools.HttpResponseParser(self)
        self.failed = 0

    def connection_made(self, transport: Any) -> None:
        self._transport = transport
        self._ask()

    def data_received(self, data: bytes) -> None:
        self._parser.feed_data(data)

    def on_message_complete(self) -> None:
        self._times_s.append(time.perf_counter() - self._began)
        self.failed += self._parser.get_status_code() >= 400
        if time.perf_counter() < self._until:
            self._ask()
        else:
            self._transport.close()

    def connection_lost(self, _error: Exception | None) -> None:
        self.failed += time.perf_counter() < self._until
        self._done.set_result(None)

    def _ask(self) -> None:
        self._began = time.perf_counter()
        self._transport.write(next(self._requests))


async def run(port: int, connections: int, seconds: float, paths: list[str]) -> str:
    """Ask for so many seconds; the line of numbers."""
    loop = asyncio.get_running_loop()
    requests = cycle([Question("GET", path).raw(f"{HOST}:{port}") for path in paths])
    times_s: list[float] = []
    began = time.perf_counter()
    ends = [loop.create_future() for _ in range(connections)]
    made = [
        await loop.create_connection(lambda end=end: Asker(requests, began + seconds, times_s, end), HOST, port)
        for end in ends
    ]
    await asyncio.gather(*ends)
    took_us = round((time.perf_counter() - began) * 1e6)
    cuts = statistics.quantiles(times_s, n=100)
    p50, p90, p99 = (round(cuts[at - 1] * 1e6) for at in (50, 90, 99))
    failed = sum(asker.failed for _, asker in made)
    return f"RESULT {len(times_s)} {took_us} {p50} {p90} {p99} {failed}"


if __name__ == "__main__":
    paths = Path(sys.argv[4]).read_text(encoding="utf-8").split()
    print(uvloop.run(run(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), paths)))
