"""How fast the service answers, each number beside its floors from the same run: `make bench`. Measures, never gates.

The server has one processor, one worker and one thread, the client the other processor. Floors:
(a) the same server design (uvicorn, uvloop, httptools) sending the same bytes precomputed, from a bare Starlette route;
(b) such a route with a few bytes of JSON; (c) the arithmetic alone, in a process without a server.
"""

from __future__ import annotations

import argparse
import os
import time

from tests.benchmarks import batches, comparison, compute, latency, load, starts
from tests.benchmarks.machine import CLIENT_CPU, described, load_note
from tests.benchmarks.processes import server, service
from tests.benchmarks.report import Bar, bars_table, write_part

PARTS = ("latency", "load", "batch", "eager", "start")


def main() -> None:
    """Measure, print, and keep the page."""
    asked = _arguments()
    os.sched_setaffinity(0, {CLIENT_CPU})
    before, began = os.getloadavg(), time.perf_counter()
    texts, bars = _measured(asked)
    minutes = (time.perf_counter() - began) / 60
    repeats = f"{asked.repeats} requests of each kind" + (", a quick run" if asked.quick else "")
    command = "make bench" + (" ARGS=--quick" if asked.quick else "")
    head = (
        f"## Serving\n\n`{command}` ({minutes:.0f} min; {repeats}, medians). {described()} {load_note(before)}\n\n"
        "One worker, one thread. Questions vary from one to the next, so no answer is a repetition. Floors, measured "
        "in turn with the service: (a) the same server design (uvicorn, uvloop, httptools) sending the same bytes "
        "precomputed from a bare Starlette route; (b) such a route with a few bytes of JSON; (c) the arithmetic alone."
    )
    markdown = "\n\n".join([head, bars_table(bars), *texts])
    print(f"\n{markdown}")
    if not asked.only and not asked.no_page:
        write_part("serving", markdown)


def _measured(asked: argparse.Namespace) -> tuple[list[str], list[Bar]]:
    wanted = asked.only or PARTS
    found = []
    if {"latency", "load", "batch"} & set(wanted):
        alone = compute.measured(asked.repeats)
        with service() as ours, server("floors") as floors:
            if "latency" in wanted:
                found.append(compute.described(alone))
                found.append(latency.measure(ours, floors, alone, asked.repeats))
            if "load" in wanted:
                found.append(load.measure(ours, floors, asked.seconds, asked.rounds))
            if "batch" in wanted:
                found.append(batches.measure(ours, floors, alone, max(5, asked.repeats // 10), asked.seconds))
    if "eager" in wanted:
        found.append(comparison.measure(max(5, asked.repeats // 10), asked.seconds, asked.rounds))
    if "start" in wanted:
        found.append(starts.measure(2 if asked.quick else 5))
    return [text for text, _ in found], [bar for _, bars in found for bar in bars]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="half a minute in place of a few")
    parser.add_argument("--only", action="append", choices=PARTS, help="measure this part; leaves the page alone")
    parser.add_argument("--no-page", action="store_true", help="print only, keep docs/performance.md as it is")
    asked = parser.parse_args()
    asked.repeats, asked.rounds, asked.seconds = (20, 1, 1.0) if asked.quick else (200, 3, 5.0)
    return asked


if __name__ == "__main__":
    main()
