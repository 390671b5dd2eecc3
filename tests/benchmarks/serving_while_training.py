"""What predictions cost while a training job runs on the same two processors: measures, never gates.

    python -m tests.benchmarks.serving_while_training --seconds 60

A real server with the shipped model and its supervised worker, as an operator runs them: the worker has one thread and
yields (nice 10). One client asks for 201 points as JSON at a steady rate; a request's time counts from when it was
due, so a stall is not hidden by the requests that it kept back. Short phases with and without a job take turns, so
that what else happens on the machine falls on both.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import psutil

import model_store

PORT = 8018
TOKEN = "the token of a benchmark"
JOBS = "/v1/admin/training-jobs"
QUESTION = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60, "horizon_s": 10, "dt_s": 0.05}
JOB = {"datasets": ["paper", "mass", "space"], "architecture": "paper_network", "budget": {"max_epochs": 10_000}}
RATE_PER_S = 20
PROCESSORS = 2


@dataclass
class Kind:
    """What all phases of one kind saw."""

    times_ms: list[float] = field(default_factory=list)
    worker_s: float = 0.0
    seconds: float = 0.0

    def row(self, name: str) -> str:
        cuts = statistics.quantiles(self.times_ms, n=100)
        worker = 100 * self.worker_s / self.seconds
        numbers = (cuts[49], cuts[89], cuts[98], max(self.times_ms))
        return f"| {name} | {len(self.times_ms)} | {worker:.0f} % | {' | '.join(f'{each:.2f}' for each in numbers)} |"

    def quantile(self, percent: int) -> float:
        return statistics.quantiles(self.times_ms, n=100)[percent - 1]


@contextmanager
def server() -> Iterator[tuple[httpx.Client, psutil.Process]]:
    """A real server and its client; the store is a copy, for jobs write to it."""
    folder = Path(tempfile.mkdtemp(prefix="serving-"))
    shipped = Path(model_store.__file__).parent
    for part in ("models", "datasets"):
        shutil.copytree(shipped / part, folder / "store" / part)
    settings = {
        "store_url": folder / "store",
        "jobs_database_url": f"sqlite:///{folder / 'jobs.sqlite'}",
        "admin_token": TOKEN,
        "port": PORT,
        "log_level": "warning",
    }
    environment = os.environ | {f"ROVER_TWIN_{name.upper()}": str(value) for name, value in settings.items()}
    process = subprocess.Popen([sys.executable, "-m", "service", "serve"], env=environment)
    headers = {"Authorization": f"Bearer {TOKEN}", "Accept": "application/json"}
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{PORT}", headers=headers, timeout=60, trust_env=False) as client:
            wait_until(lambda: client.get("/health/ready").status_code == 200)
            server_process = psutil.Process(process.pid)
            wait_until(lambda: bool(server_process.children()))
            yield client, server_process.children()[0]
    finally:
        process.terminate()
        process.wait(60)
        shutil.rmtree(folder)


def wait_until(condition: Callable[[], bool], timeout_s: float = 120) -> None:
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        try:
            if condition():
                return
        except httpx.TransportError:
            pass
        time.sleep(0.05)
    raise SystemExit("it did not happen in time")


@contextmanager
def training(client: httpx.Client) -> Iterator[None]:
    """A job that fits epoch after epoch until the block ends."""
    answer = client.post(JOBS, json=JOB | {"model": "benchmark"})
    answer.raise_for_status()
    address = answer.headers["location"]

    def fits() -> bool:
        job = client.get(address).raise_for_status().json()
        assert job["state"] in ("queued", "running"), job
        return bool(job["progress"] and job["progress"]["epoch"])

    wait_until(fits)
    yield
    client.post(f"{address}/cancel").raise_for_status()


def ask_for(seconds: float, client: httpx.Client, worker: psutil.Process, seen: Kind) -> None:
    """Ask at the steady rate, and note how long each answer took from when its request was due."""
    before, began = sum(worker.cpu_times()[:2]), time.perf_counter()
    for number in range(int(seconds * RATE_PER_S)):
        due = began + number / RATE_PER_S
        time.sleep(max(0.0, due - time.perf_counter()))
        client.get("/v1/predictions", params=QUESTION).raise_for_status()
        seen.times_ms.append((time.perf_counter() - due) * 1e3)
    seen.worker_s += sum(worker.cpu_times()[:2]) - before
    seen.seconds += time.perf_counter() - began


def main() -> None:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60, help="of each kind, in all")
    parser.add_argument("--phases", type=int, default=6, help="of each kind")
    asked = parser.parse_args()
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:PROCESSORS])
    idle, busy = Kind(), Kind()
    length_s = asked.seconds / asked.phases
    with server() as (client, worker):
        ask_for(3, client, worker, Kind())  # the first requests import what they need
        for _ in range(asked.phases):
            ask_for(length_s, client, worker, idle)
            with training(client):
                ask_for(length_s, client, worker, busy)
            wait_until(lambda: worker.cpu_percent(0.5) < 20)  # it has noticed
    others = statistics.mean(os.getloadavg())
    print(
        f"{platform.machine()}, {PROCESSORS} processors for server, worker and client, {RATE_PER_S} requests a second, "
        f"{asked.phases} phases of {length_s:g} s of each kind in turn; load average at the end {others:.1f}\n"
    )
    print("| | requests | processor time of the worker | p50 ms | p90 ms | p99 ms | slowest ms |")
    print("|---|---|---|---|---|---|---|")
    print(idle.row("no job"))
    print(busy.row("training job"))
    ratios = [busy.quantile(percent) / idle.quantile(percent) for percent in (50, 90, 99)]
    print(f"| ratio | | | {' | '.join(f'{ratio:.2f}' for ratio in ratios)} | |")


if __name__ == "__main__":
    main()
