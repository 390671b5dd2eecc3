"""Real servers in processes of their own, each on the one processor for servers."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.benchmarks.client import Connection, Question
from tests.benchmarks.machine import SERVER_CPU, python, running_on

HOST = "127.0.0.1"
START_LIMIT_S = 120.0
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@dataclass(frozen=True, slots=True)
class Running:
    """A server that is ready."""

    name: str
    port: int
    pid: int
    ready_after_s: float

    def connect(self) -> Connection:
        """A new connection to it."""
        return Connection(HOST, self.port)

    def resident_mib(self) -> float:
        """Memory of the process and of what it started."""
        family = [self.pid, *_children(self.pid)]
        return sum(_resident_kib(pid) for pid in family) / 1024

    def cpu_ms(self) -> float:
        """Processor time of all threads of the process since its start."""
        threads = Path(f"/proc/{self.pid}/task").glob("*/schedstat")
        return sum(int(each.read_text(encoding="utf-8").split()[0]) for each in threads) / 1e6

    def maps(self, library: str) -> bool:
        """Whether the process has a shared library of that name in memory."""
        return library in Path(f"/proc/{self.pid}/maps").read_text(encoding="utf-8")


@contextmanager
def service(store: str | None = None, settings: Mapping[str, str] | None = None) -> Iterator[Running]:
    """`rover-twin serve` with one thread, quiet as the floors are, other settings as they come."""
    port = free_port()
    given = {"THREADS": "1", "LOG_LEVEL": "warning"} | ({"STORE_URL": store} if store else {}) | dict(settings or {})
    environment = {f"ROVER_TWIN_{name}": value for name, value in given.items()}
    command = python("service", "serve", "--port", str(port))
    with _started("service", command, port, "/health/ready", environment) as running:
        yield running


@contextmanager
def server(module: str) -> Iterator[Running]:
    """One of the servers that the service is compared with."""
    port = free_port()
    with _started(module, python(f"tests.benchmarks.{module}", str(port)), port, "/ready", {}) as running:
        yield running


@contextmanager
def _started(name: str, command: list[str], port: int, ready: str, settings: Mapping[str, str]) -> Iterator[Running]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("ROVER_TWIN_")}
    with running_on(SERVER_CPU):
        began = time.perf_counter()
        process = subprocess.Popen(command, env=environment | _ONE_THREAD | settings)
    try:
        while not _is_ready(port, ready):
            if process.poll() is not None or time.perf_counter() - began > START_LIMIT_S:
                raise SystemExit(f"{' '.join(command)} did not become ready")
            time.sleep(0.005)
        yield Running(name, port, process.pid, time.perf_counter() - began)
    finally:
        process.terminate()
        try:
            process.wait(60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def free_port() -> int:
    """A port that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])


def _is_ready(port: int, path: str) -> bool:
    try:
        with Connection(HOST, port, 5.0) as connection:
            connection.ask(Question("GET", path))
    except (OSError, RuntimeError):
        return False
    return True


def _children(pid: int) -> list[int]:
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()
    return [each for child in map(int, found) for each in (child, *_children(child))]


def _resident_kib(pid: int) -> int:
    lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))
