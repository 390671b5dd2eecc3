"""Many clients at once: throughput and tail, beside bare routes under the same load. By wrk if it is there."""

from __future__ import annotations

import shutil
import statistics
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.benchmarks.compute import STEPS_S
from tests.benchmarks.floors import keep_answer
from tests.benchmarks.latency import ask_of
from tests.benchmarks.machine import CLIENT_CPU, python, running_on
from tests.benchmarks.processes import HOST, Running
from tests.benchmarks.report import Bar, table

CONCURRENCY = (1, 8, 32)
CROWD = 256
"""Connections that never pause, more than a service of this size expects."""
_FASTEST_PER_S = 12_000
_SCRIPT = Path(__file__).with_name("load.lua")


@dataclass(frozen=True, slots=True)
class Load:
    """What one server did under load; times in ms."""

    per_s: float
    p50: float
    p90: float
    p99: float

    @classmethod
    def parsed(cls, output: str) -> Load:
        """From the line that both load generators print. Raises RuntimeError if a request failed."""
        line = next((line for line in output.splitlines() if line.startswith("RESULT ")), "")
        count, took_us, p50, p90, p99, failed = map(int, line.split()[1:])
        if failed or not count:
            raise RuntimeError(f"{failed} of {count} requests failed:\n{output}")
        return cls(count / took_us * 1e6, p50 / 1e3, p90 / 1e3, p99 / 1e3)

    @classmethod
    def middle(cls, rounds: Sequence[Load]) -> Load:
        """Of several rounds the median of each number."""
        return cls(*(statistics.median(getattr(each, name) for each in rounds) for name in cls.__slots__))


def generator() -> str:
    """Which load generator there is."""
    return "wrk" if shutil.which("wrk") else "tests.benchmarks.load_client (wrk is not installed)"


def apply(server: Running, paths: Sequence[str], connections: int, seconds: float) -> Load:
    """One round."""
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file, running_on(CLIENT_CPU):
        file.write("\n".join(paths))
        file.flush()
        if shutil.which("wrk"):
            options = ["-t1", f"-c{connections}", f"-d{seconds:g}s", "--timeout", "30s", "-s", str(_SCRIPT)]
            command = ["wrk", *options, f"http://{HOST}:{server.port}", file.name]
        else:
            numbers = [str(server.port), str(connections), str(seconds)]
            command = python("tests.benchmarks.load_client", *numbers, file.name)
        return Load.parsed(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def paths_of(form: str, dt_s: float, seconds: float) -> list[str]:
    """Enough addresses for so many seconds, each about another scenario."""
    return [question.path for question in ask_of(form, dt_s, round(_FASTEST_PER_S * seconds))]


def measure(service: Running, floors: Running, seconds: float, rounds: int) -> tuple[str, list[Bar]]:
    """The table for 201 points, and its bars."""
    with service.connect() as asked, floors.connect() as floor:
        same = keep_answer(floor, "load", asked.ask(ask_of("json", STEPS_S[201], 1)[0]))
    sides: dict[str, tuple[Running, Callable[[], list[str]]]] = {
        "service": (service, lambda: paths_of("json", STEPS_S[201], seconds)),
        "floor (a), the same bytes": (floors, lambda: [same]),
        "floor (b), a few bytes": (floors, lambda: ["/tiny"]),
    }
    rows, found = [], {}
    for connections in (*CONCURRENCY, CROWD):
        turns = [
            {name: apply(server, paths(), connections, seconds) for name, (server, paths) in sides.items()}
            for _ in range(rounds)
        ]
        for name in sides:
            load = Load.middle([turn[name] for turn in turns])
            found[connections, name] = load
            share = found[connections, "service"].per_s / load.per_s
            rows.append([str(connections), name, load.per_s, load.p50, load.p90, load.p99, load.p99 / load.p50, share])
            print(f"{connections} connections, {name}: {load.per_s:.0f}/s, p99 {load.p99:.2f} ms", flush=True)
    bars = _bars(found)
    names = ("connections", "what", "requests/s", "p50", "p90", "p99", "p99 / p50", "service / this")
    text = (
        f"### Under load\n\n201 points in JSON. Load by {generator()}, closed loop, {rounds} rounds of {seconds:g} s "
        "in turn, medians of the rounds, ms.\n\n"
    )
    return text + table(names, rows), bars


def _bars(found: Mapping[tuple[int, str], Load]) -> list[Bar]:
    def over(connections: int, floor: str) -> float:
        return found[connections, "service"].per_s / found[connections, floor].per_s

    def tail(connections: int) -> float:
        return found[connections, "service"].p99 / found[connections, "service"].p50

    one, many, what = CONCURRENCY[0], CONCURRENCY[-1], "201 points, json"
    return [
        Bar(f"{what}, {one} connection: rate over floor (a)", over(one, "floor (a), the same bytes"), 0.4, True),
        Bar(f"{what}, {many} connections: rate over floor (b)", over(many, "floor (b), a few bytes"), 0.25, True),
        Bar(f"{what}, {many} connections: p99 over p50", tail(many), 2.5),
        Bar(f"{what}, {CROWD} connections: p99 over p50", tail(CROWD), 4.0),
    ]
