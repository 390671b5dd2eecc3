"""How fast one prediction is, alone and over HTTP: `make bench`. Measures, never gates.

Everything runs on one processor with one thread: the core first inside this process, then a real server with the
shipped model in a process of its own, asked over loopback with one kept connection.
"""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import httpx
import psutil

ONE_PROCESSOR = {min(os.sched_getaffinity(0))}
SCENARIO = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60, "horizon_s": 10}
STEPS_S = {201: 0.05, 2_001: 0.005, 20_001: 0.0005}
REPEATS = 60
PORT = 8017


def timed_ms(work: Callable[[], object], repeats: int = REPEATS) -> tuple[float, float]:
    """Median and 90th percentile of single calls, after five unmeasured ones."""
    for _ in range(5):
        work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append((time.perf_counter() - start) * 1e3)
    return statistics.median(times), statistics.quantiles(times, n=10)[-1]


def compute() -> Iterator[tuple[str, float, float]]:
    """The twin itself, no HTTP."""
    import torch

    from model_store import ModelStore
    from service.settings import load_settings
    from service.twin import Scenario, sample_times
    from service.twin.load import load_twin

    torch.set_num_threads(1)
    store = ModelStore.open(load_settings().store_url)
    resolved = store.resolve("viper-lunar")
    twin = load_twin(store, resolved.name, resolved.version)
    scenario = Scenario(*SCENARIO.values())
    for points, dt_s in STEPS_S.items():
        times = sample_times(10.0, dt_s)
        assert len(times) == points
        yield f"compute, {points:,} points", *timed_ms(lambda times=times: twin.predict(scenario, times))


@contextmanager
def server() -> Iterator[tuple[psutil.Process, float]]:
    """A real server on one processor; the process and its seconds from start to ready."""
    command = [sys.executable, "-m", "service", "serve", "--port", str(PORT)]
    environment = os.environ | {"ROVER_TWIN_THREADS": "1", "ROVER_TWIN_LOG_LEVEL": "warning"}
    started = time.perf_counter()
    process = subprocess.Popen(command, env=environment)
    try:
        while True:
            try:
                if httpx.get(f"http://127.0.0.1:{PORT}/health/ready").status_code == 200:
                    break
            except httpx.TransportError:
                pass
            if process.poll() is not None or time.perf_counter() - started > 120:
                raise SystemExit("the server did not become ready")
            time.sleep(0.02)
        yield psutil.Process(process.pid), time.perf_counter() - started
    finally:
        process.terminate()
        process.wait(60)


def requests() -> Iterator[tuple[str, float, float]]:
    """Whole requests as a client sees them."""
    with httpx.Client(base_url=f"http://127.0.0.1:{PORT}", timeout=60) as client:
        for kind in ("json", "csv"):
            for points, dt_s in STEPS_S.items():
                query = SCENARIO | {"dt_s": dt_s, "format": kind}

                def ask(query: dict[str, object] = query) -> None:
                    client.get("/v1/predictions", params=query).raise_for_status()

                yield f"request, {kind}, {points:,} points", *timed_ms(ask)
        yield "request, /health/live", *timed_ms(lambda: client.get("/health/live").raise_for_status())


def show(rows: Iterator[tuple[str, float, float]]) -> None:
    for name, median, p90 in rows:
        print(f"| {name} | {median:.2f} | {p90:.2f} |", flush=True)


def main() -> None:
    """Print a Markdown table."""
    os.sched_setaffinity(0, ONE_PROCESSOR)
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, one processor, one thread"
    )
    print(f"\n| what ({REPEATS} calls each) | median ms | p90 ms |\n|---|---|---|")
    show(compute())
    with server() as (process, ready_s):
        idle = process.memory_info().rss
        show(requests())
        busy = process.memory_info().rss
    print(f"\nstart to ready {ready_s:.2f} s; resident {idle / 2**20:.0f} MB when ready, {busy / 2**20:.0f} MB after")


if __name__ == "__main__":
    main()
