"""Two replicas behind a balancer are replaced in turn while ordinary clients keep asking: how many requests fail?

`python -m tests.benchmarks.rolling RESTARTS`. The balancer does what all do: it asks for readiness, gives a new
connection to a ready replica, and leaves those that there are where they are. It repeats no request.
"""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import sys
import time
from contextlib import suppress
from dataclasses import dataclass, field

import httpx

from tests.benchmarks.machine import python
from tests.benchmarks.processes import HOST, free_port

_PROBE_S = 0.2
_READY_S = 90.0
_QUESTION = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 60}


@dataclass(slots=True)
class Replica:
    """One of the servers, started again and again on the same port."""

    port: int = field(default_factory=free_port)
    process: asyncio.subprocess.Process | None = None
    ready: bool = False

    async def start(self) -> None:
        """Returns when it is ready. Raises TimeoutError."""
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")}
        environment |= {"ROVER_TWIN_THREADS": "1", "ROVER_TWIN_LOG_LEVEL": "warning"}
        command = python("service", "serve", "--port", str(self.port))
        self.process = await asyncio.create_subprocess_exec(*command, env=environment)
        async with asyncio.timeout(_READY_S):
            while not self.ready:
                await asyncio.sleep(0.05)

    async def end(self) -> None:
        """Tells it to end, and waits until it has."""
        assert self.process is not None
        if self.process.returncode is None:
            self.process.send_signal(signal.SIGTERM)
            await self.process.wait()

    async def probe(self) -> None:
        """Asks for readiness, without end."""
        async with httpx.AsyncClient(trust_env=False, timeout=2) as client:
            while True:
                try:
                    self.ready = (await client.get(f"http://{HOST}:{self.port}/health/ready")).status_code == 200
                except httpx.TransportError:
                    self.ready = False
                await asyncio.sleep(_PROBE_S)


class Balancer:
    """Connections to a port go to one of the ready replicas, in turn."""

    def __init__(self, replicas: list[Replica]) -> None:
        self._replicas = replicas
        self._turn = 0
        self.refused = 0  # connections for which there was no replica

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection."""
        with suppress(OSError):
            for _ in range(len(self._replicas)):
                self._turn += 1
                ready = [each for each in self._replicas if each.ready]
                if not ready:
                    break
                try:
                    there = await asyncio.open_connection(HOST, ready[self._turn % len(ready)].port)
                except OSError:
                    continue
                try:
                    await asyncio.gather(_passed(reader, there[1]), _passed(there[0], writer))
                finally:
                    there[1].close()
                    writer.close()
                return
        self.refused += 1
        writer.close()


async def _passed(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    with suppress(OSError):
        while content := await source.read(65536):
            sink.write(content)
            await sink.drain()
    with suppress(OSError):
        sink.close()


@dataclass(slots=True)
class Outcome:
    """What the clients saw, and the replicas' restarts."""

    answered: int = 0
    failed: list[str] = field(default_factory=list)
    longest_s: float = 0.0
    restarts: int = 0
    took_s: float = 0.0


async def _keep_asking(client: httpx.AsyncClient, seen: Outcome, pause_s: float) -> None:
    while True:
        began = time.perf_counter()
        try:
            answer = await client.post("/v1/predictions", json=_QUESTION)
            if answer.status_code == 200:
                seen.answered += 1
            else:
                seen.failed.append(f"{answer.status_code} {answer.text[:200]}")
        except httpx.HTTPError as error:
            seen.failed.append(f"{type(error).__name__}: {error}")
        seen.longest_s = max(seen.longest_s, time.perf_counter() - began)
        await asyncio.sleep(pause_s)


async def roll(restarts: int, clients: int = 16) -> Outcome:
    """So many restarts, the replicas in turn, while so many clients ask; each keeps its connection.

    Half of them ask twenty times a second, half every second and a half: those are silent while a replica ends.
    """
    replicas, seen = [Replica(), Replica()], Outcome()
    began = time.perf_counter()
    async with asyncio.TaskGroup() as tasks:
        probes = [tasks.create_task(each.probe()) for each in replicas]
        front = await asyncio.start_server(Balancer(replicas).serve, HOST, 0, backlog=socket.SOMAXCONN)
        url = f"http://{HOST}:{front.sockets[0].getsockname()[1]}"
        try:
            await asyncio.gather(*(each.start() for each in replicas))
            askers, asking = [], []
            for number in range(clients):
                client = httpx.AsyncClient(base_url=url, trust_env=False, timeout=30)
                asking.append(client)
                askers.append(tasks.create_task(_keep_asking(client, seen, 0.05 if number % 2 else 1.5)))
            await asyncio.sleep(1)
            for _ in range(restarts):
                replica = replicas[seen.restarts % 2]
                await replica.end()
                replica.ready = False
                await replica.start()
                seen.restarts += 1
            for each in askers:
                each.cancel()
            for each in asking:
                await each.aclose()
        finally:
            for each in probes:
                each.cancel()
            await asyncio.gather(*(each.end() for each in replicas if each.process))
            front.close()
            await asyncio.sleep(0.2)  # until all connections are closed
    seen.took_s = time.perf_counter() - began
    return seen


if __name__ == "__main__":
    print(asyncio.run(roll(int(sys.argv[1]) if len(sys.argv) > 1 else 10)))
