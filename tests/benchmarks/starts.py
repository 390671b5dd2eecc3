"""From the start of the process to the first ready, and what the imports cost."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections import Counter

from tests.benchmarks.machine import SERVER_CPU, running_on
from tests.benchmarks.processes import service
from tests.benchmarks.report import Bar, Sample, table

_LINE = re.compile(r"import time:\s+(\d+) \|\s+\d+ \|\s+(\S+)")
_SHOWN = 14


def measure(starts: int) -> tuple[str, list[Bar]]:
    """The tables and the bar."""
    ready, resident, torch = [], [], False
    for _ in range(starts):
        with service() as running:
            ready.append(running.ready_after_s)
            resident.append(running.resident_mib())
            torch = torch or running.maps("libtorch")
    took, memory = Sample(ready), Sample(resident)
    print(f"start to ready {took.p50:.2f} s", flush=True)
    blank, with_torch = _seconds("pass"), _seconds("import torch")
    own = _imports()
    rows = [[f"`{name}`", cost] for name, cost in own.most_common(_SHOWN)]
    rest = sum(own.values()) - sum(cost for _, cost in own.most_common(_SHOWN))
    rows += [["all others", rest], ["**together**", sum(own.values())]]
    needs = "has it in memory" if torch else "does not load it for the shipped version"
    text = (
        "### Start\n\nFrom the start of the process to a 200 of `/health/ready`, on one processor: median "
        f"{took.p50:.2f} s, longest {max(ready):.2f} s of {starts} starts; {memory.p50:.0f} MiB resident then. An "
        f"interpreter that does nothing takes {blank:.2f} s; "
        f"`import torch` adds {with_torch - blank:.2f} s, and the service {needs}.\n\n"
        "What importing the service costs, by package, each without what it imports itself (`-X importtime`, which "
        f"adds some), ms:\n\n{table(('package', 'ms'), rows)}"
    )
    return text, [Bar("start to ready, s", took.p50, 1.0)]


def _seconds(code: str) -> float:
    """How long an interpreter takes for it; the second time, when its files are in memory."""
    with running_on(SERVER_CPU):
        for _ in range(2):
            began = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], check=True)
            took = time.perf_counter() - began
    return took


def _imports() -> Counter[str]:
    """Milliseconds of importing what `serve` imports before it starts, by top-level package."""
    code = (
        "import service.cli.main, service.cli.commands.serve, service.server, uvloop, httptools, "
        "uvicorn.protocols.http.httptools_impl"
    )
    command = [sys.executable, "-X", "importtime", "-c", code]
    with running_on(SERVER_CPU):
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=dict(os.environ))
    costs: Counter[str] = Counter()
    for self_us, name in _LINE.findall(done.stderr):
        package = name.split(".")[0]
        costs["standard library" if package in sys.stdlib_module_names else package] += int(self_us) / 1e3
    return costs
