"""The service beside the afternoon's solution: `tests.benchmarks.eager`, the paper's network in eager torch."""

from __future__ import annotations

from urllib.parse import urlencode

from tests.benchmarks.client import Question, scenarios
from tests.benchmarks.latency import WARM_UP, Side, ask_of, in_turns
from tests.benchmarks.processes import Running, server, service
from tests.benchmarks.report import Bar, Sample, table

_STEPS_S = {101: 0.1, 20_001: 0.0005}
_NAMES = ("the service", "the service with the same network", "eager torch in a plain FastAPI route")


def measure(repeats: int) -> tuple[str, list[Bar]]:
    """The table and its bars, from servers of their own."""
    rows: list[list[object]] = []
    with service() as ours, server("eager") as theirs:
        for points, dt_s in _STEPS_S.items():
            times = repeats if points > 1_000 else 5 * repeats
            taken = in_turns(_sides(ours, theirs, dt_s, times + WARM_UP), times)
            faster = _times_faster(taken)
            both = zip(_NAMES, taken, faster, strict=True)
            rows += [[name, f"{points:,}", each.p50, each.p90, ratio] for name, each, ratio in both]
            print(f"{points:,} points: {faster[0]:.1f} and {faster[1]:.1f} times faster than eager torch", flush=True)
    text = (
        "### Against eager torch\n\nThe paper's network (five layers, 30 to 500 wide) in eager PyTorch behind a "
        "FastAPI route that returns lists: points in JSON, ms.\n\n"
    )
    what = "20,001 points, json: times faster than the paper's network in eager torch"
    bars = [Bar(what, faster[0], 10, at_least=True), Bar(f"{what}, with that network", faster[1], 4, at_least=True)]
    return text + table(("what", "points", "p50", "p90", "times faster"), rows), bars


def _sides(ours: Running, theirs: Running, dt_s: float, count: int) -> list[Side]:
    """The champion, our server of the network, and theirs, asked the same."""
    query = [urlencode({**scenario, "horizon_s": 10, "dt_s": dt_s}) for scenario in scenarios(count)]
    paper = [Question("GET", f"/v1/predictions?model=viper-lunar-paper&{each}") for each in query]
    plain = [Question("GET", f"/predictions?{each}") for each in query]
    return [(ours, ask_of("json", dt_s, count)), (ours, paper), (theirs, plain)]


def _times_faster(taken: list[Sample]) -> list[float]:
    return [taken[-1].p50 / each.p50 for each in taken]
