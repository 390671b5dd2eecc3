"""What traces cost a prediction of 201 points: `python -m tests.benchmarks.tracing_cost`, some minutes.

Servers without and with traces are asked in turn, request by request, so that a busy machine hurts all alike.
"""

from __future__ import annotations

import os
import statistics
import timeit

from service.tracing import span_of
from service.twin.twin import Twin
from tests.benchmarks.compute import STEPS_S
from tests.benchmarks.latency import Side, ask_of, in_turns
from tests.benchmarks.machine import described, load_note
from tests.benchmarks.processes import service
from tests.benchmarks.report import table
from tests.tracing.collector import collecting

ROUNDS, REQUESTS = 5, 1000
SAMPLED = {"OTEL_TRACES_SAMPLER": "parentbased_traceidratio", "OTEL_TRACES_SAMPLER_ARG": "0.01"}


def off_ns() -> float:
    """What a span that is not made takes, ns; a prediction has one such place."""
    twin: Twin = object.__new__(Twin)  # nothing is asked of it

    def nothing_made() -> None:
        with span_of("predict", twin, 1):
            pass

    count = 100_000
    empty = min(timeit.repeat(lambda: None, number=count, repeat=5))
    return (min(timeit.repeat(nothing_made, number=count, repeat=5)) - empty) / count * 1e9


def compared(sides: dict[str, Side]) -> str:
    """The table: of each server the median of the rounds, and the median of the ratios to the first."""
    p50: dict[str, list[float]] = {name: [] for name in sides}
    cpu: dict[str, list[float]] = {name: [] for name in sides}
    for _ in range(ROUNDS):
        before = [server.cpu_ms() for server, _ in sides.values()]
        taken = in_turns(list(sides.values()), REQUESTS)
        for (name, (server, _)), sample, began in zip(sides.items(), taken, before, strict=True):
            p50[name].append(sample.p50)
            cpu[name].append((server.cpu_ms() - began) / REQUESTS)
    rows = []
    for name in sides:
        ratios = [
            statistics.median(one / other for one, other in zip(of[name], of["off"], strict=True)) for of in (p50, cpu)
        ]
        rows.append([name, statistics.median(p50[name]), ratios[0], statistics.median(cpu[name]), ratios[1]])
    return table(("traces", "p50, ms", "over off", "processor, ms", "over off"), rows)


def main() -> None:
    """Measure and print."""
    load = os.getloadavg()
    with collecting() as collector:
        os.environ["OTEL_EXPORTER_OTLP_ENDPOINT"] = collector.url
        with service(settings={"TRACING": "false"}) as off, service(settings={"TRACING": "true"}) as on:
            os.environ |= SAMPLED
            with service(settings={"TRACING": "true"}) as sampled:
                questions = ask_of("json", STEPS_S[201], REQUESTS)
                print(compared({"off": (off, questions), "on": (on, questions), "on, 1 % kept": (sampled, questions)}))
        print(f"\n{len(collector.named('GET /v1/predictions'))} spans of requests came to the collector.")
    print(f"A span that is not made: {off_ns():.0f} ns.\n\n{described()} {load_note(load)}")


if __name__ == "__main__":
    main()
