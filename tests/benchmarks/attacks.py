"""The attacks of docs/performance.md, each on a service of its own: `python -m tests.benchmarks.attacks [--only NAME]`

Bounded, over loopback, and nothing is gated: times depend on the machine, ratios less so. Writes the page unless only
some were asked for.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import shutil
import socket
import threading
import time
from collections.abc import Callable, Iterator

from tests.benchmarks import attackers, rolling
from tests.benchmarks.load import Load, paths_of
from tests.benchmarks.load import apply as apply_load
from tests.benchmarks.machine import CLIENT_CPU, described, load_note, running_on
from tests.benchmarks.processes import HOST, service
from tests.benchmarks.report import Bar, bars_table, write_part

_SCENARIO = "slope_deg=20&mass_kg=430&torque_nm=60"
LARGE = f"/v1/predictions?{_SCENARIO}&horizon_s=20&dt_s=0.001&format=usda"  # not answered on the event loop
_SMALL = f"/v1/predictions?{_SCENARIO}"
_SUGGESTIONS = "/v1/models/viper-lunar/versions/5/suggested-runs?n=64"
_GIB = 1024.0


def storms() -> Iterator[Bar]:
    """600 and 1,000 clients that ask again at once, for 20,001 points."""
    with service() as server, running_on(CLIENT_CPU):
        rates: dict[int, list[float]] = {32: [], 600: [], 1000: []}
        work: dict[int, list[float]] = {32: [], 600: [], 1000: []}
        for _ in range(2):
            for clients in rates:
                cpu_ms = server.cpu_ms()
                counts = attackers.storm(server, clients, 6, LARGE)
                rates[clients].append(counts[200] / 6)
                work[clients].append(counts[200] / (server.cpu_ms() - cpu_ms))
                print(f"{clients} clients: {counts[200] / 6:.0f} answers and {counts[503] / 6:.0f} refusals a second")
        for clients in (600, 1000):
            what = f"{clients} clients ask again at once: answers"
            yield Bar(f"{what} a second, over those to 32", max(rates[clients]) / max(rates[32]), 0.7, True)
            yield Bar(f"{what} for a processor second, over those to 32", max(work[clients]) / max(work[32]), 0.7, True)


def crowd() -> Iterator[Bar]:
    """256 connections that never pause, and newcomers meanwhile."""
    with service() as server, running_on(CLIENT_CPU):
        usual = apply_load(server, paths_of("json", 0.05, 5), 32, 5)
        times: list[tuple[int, float]] = []
        over = threading.Event()

        def newcomers() -> None:
            while not over.wait(0.3):
                times.append(attackers.asked(server, "/health/live"))

        thread = threading.Thread(target=newcomers, daemon=True)
        thread.start()
        load: Load = apply_load(server, paths_of("json", 0.05, 8), 256, 8)
        over.set()
        thread.join()
    yield Bar("256 busy connections: longest wait of a newcomer for health, s", attackers.worst(times), 0.5)
    yield Bar("256 busy connections: p99 over p50", load.p99 / load.p50, 4.0)
    yield Bar("256 busy connections: requests a second over those of 32", load.per_s / usual.per_s, 0.9, True)


def silence() -> Iterator[Bar]:
    """2,100 connections that say nothing."""
    with service() as server, attackers.silent(server, 2100):
        health = [attackers.asked(server, "/health/live") for _ in range(20)]
        others = [attackers.asked(server, _SMALL) for _ in range(20)]
    failed = sum(status != 200 for status, _ in health + others)
    yield Bar("2,100 silent connections: failed requests of 40 newcomers", failed, 0)
    yield Bar("2,100 silent connections: longest wait of a newcomer, s", attackers.worst(health + others), 1.0)


def heads() -> Iterator[Bar]:
    """60 MB of headers on one connection."""
    with service() as server, attackers.most_memory(server) as most:
        before, sent = most(), 0
        with socket.create_connection((HOST, server.port), 10) as connection:
            try:
                connection.sendall(b"GET /health/live HTTP/1.1\r\nHost: a\r\n")
                while sent < 60 << 20:
                    connection.sendall(b"X-More: " + b"a" * 8000 + b"\r\n")
                    sent += 8010
            except OSError:
                pass
        yield Bar("60 MB of headers: taken before the connection was cut, MB", sent / 1e6, 8.0)
        yield Bar("60 MB of headers: more memory, MiB", most() - before, 16.0)


def readers() -> Iterator[Bar]:
    """40 clients that ask for the largest batch and read nothing."""
    request = attackers.large_batch()
    with service() as server, attackers.most_memory(server) as most, attackers.silent(server, 40) as connections:
        health = []
        for each in connections:
            each.sendall(request)
        ends = time.monotonic() + 60
        while time.monotonic() < ends:
            health.append(attackers.asked(server, "/health/live"))
            time.sleep(0.2)
        yield Bar("40 slow readers of the largest batch: most memory in a minute, MiB", most(), _GIB)
        yield Bar("40 slow readers: failed requests for health", sum(status != 200 for status, _ in health), 0)


def batches() -> Iterator[Bar]:
    """16 clients that ask for the largest batch and read it."""
    with service() as server, attackers.most_memory(server) as most:
        found = attackers.answers(server, attackers.large_batch(), 16, 300)
        whole = [size for status, size in found if status == 200]
        print(f"{len(whole)} of 16 answered, {max(whole, default=0) / 1e6:.0f} MB each; others {sorted(found)[:1]}")
        yield Bar("16 ordinary clients, the largest batch: most memory, MiB", most(), _GIB)
        yield Bar(
            "16 ordinary clients, the largest batch: neither answered nor told to come later",
            sum(s not in (200, 503) for s, _ in found),
            0,
        )


def mistakes() -> Iterator[Bar]:
    """A megabyte of unknown fields."""
    scenario = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 60} | {f"a{number:02d}": number for number in range(90)}
    request = attackers.post("/v1/predictions/batch", {"scenarios": [scenario] * 1000})
    with service() as server:
        before = server.cpu_ms()
        ((status, size),) = attackers.answers(server, request, 1, 60)
        assert status == 200
        yield Bar("1 MB of unknown fields: answer over request", size / len(request), 1.0)
        yield Bar("1 MB of unknown fields: processor time, ms", server.cpu_ms() - before, 500.0)


def suggestions() -> Iterator[Bar]:
    """24 clients that ask for suggestions, which take seconds, and leave after half a second; then four that stay."""
    with service() as server:
        for clients, timeout_s in ((24, 0.5), (4, 60.0)):
            leave = threading.Thread(
                target=attackers.at_once,
                args=(lambda wait=timeout_s: attackers.asked(server, _SUGGESTIONS, wait), clients),
                daemon=True,
            )
            leave.start()
            ready, small = [], []
            for _ in range(20):
                ready.append(attackers.asked(server, "/health/ready"))
                small.append(attackers.asked(server, _SMALL))
                time.sleep(0.1)
            failed = sum(status != 200 for status, _ in ready + small)
            yield Bar(
                f"{clients} clients ask for suggestions: readiness and small predictions that failed, of 40", failed, 0
            )
            leave.join()


def restarts() -> Iterator[Bar]:
    """10 rolling restarts of two replicas under 16 ordinary clients."""
    seen = asyncio.run(rolling.roll(10))
    print(f"{seen.restarts} restarts in {seen.took_s:.0f} s, {seen.answered} answers, failed: {seen.failed[:3]}")
    yield Bar(f"10 rolling restarts: failed of {seen.answered:,} requests", len(seen.failed), 0)


ATTACKS: dict[str, Callable[[], Iterator[Bar]]] = {
    each.__name__: each for each in (storms, crowd, silence, heads, readers, batches, mistakes, suggestions, restarts)
}


def main() -> None:
    """Attack, print, and keep the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=ATTACKS, help="this attack; leaves the page alone")
    asked = parser.parse_args()
    before, bars = os.getloadavg(), []
    for name in asked.only or ATTACKS:
        for bar in ATTACKS[name]():
            bars.append(bar)
            print(f"{name}: {bar.what}: {bar.value:.3g}", flush=True)
    with_wrk = "wrk" if shutil.which("wrk") else "tests.benchmarks.load_client"
    text = (
        f"### Measured\n\n`python -m tests.benchmarks.attacks`, the 256 busy connections by {with_wrk}. {described()} "
        f"{load_note(before)}\n\n{bars_table(bars)}"
    )
    print(text)
    if not asked.only:
        write_part("attacks", text)


if __name__ == "__main__":
    main()
