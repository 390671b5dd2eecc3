"""The service beside the afternoon's solution: `tests.benchmarks.eager`, the paper's network in eager torch."""

from __future__ import annotations

from urllib.parse import urlencode

from tests.benchmarks.client import Question, scenarios
from tests.benchmarks.latency import WARM_UP, Side, ask_of, in_turns
from tests.benchmarks.load import Load, apply
from tests.benchmarks.processes import Running, server, service
from tests.benchmarks.report import Bar, table

_FEW = 101
_STEPS_S = {_FEW: 0.1, 20_001: 0.0005}
_LEAST = {1: 4.0, 32: 5.0}
"""By how many ask at once: the bar of the champion's rate over theirs."""
_FASTEST_PER_S = 6_000
_NAMES = ("the service", "the service with the same network", "eager torch in a plain FastAPI route")


def measure(repeats: int, seconds: float, rounds: int) -> tuple[str, list[Bar]]:
    """The tables and their bars, from servers of their own."""
    with service() as ours, server("eager") as theirs:
        alone, bars = _one_at_a_time(ours, theirs, repeats)
        crowded, more = _under_load(ours, theirs, seconds, rounds)
    text = (
        "### Against eager torch\n\nThe paper's network (five layers, 30 to 500 wide) in eager PyTorch behind a "
        "FastAPI route that returns lists: points in JSON, ms.\n\n"
    )
    return f"{text}{alone}\n\n{crowded}", [*bars, *more]


def _one_at_a_time(ours: Running, theirs: Running, repeats: int) -> tuple[str, list[Bar]]:
    rows: list[list[object]] = []
    for points, dt_s in _STEPS_S.items():
        times = repeats if points > _FEW else 5 * repeats
        taken = in_turns(_sides(ours, theirs, dt_s, times + WARM_UP), times)
        faster = [taken[-1].p50 / each.p50 for each in taken]
        both = zip(_NAMES, taken, faster, strict=True)
        rows += [[name, f"{points:,}", each.p50, each.p90, ratio] for name, each, ratio in both]
        print(f"{points:,} points: {faster[0]:.1f} and {faster[1]:.1f} times faster than eager torch", flush=True)
    what = "20,001 points, json: times faster than the paper's network in eager torch"
    bars = [Bar(what, faster[0], 10, at_least=True), Bar(f"{what}, with that network", faster[1], 4, at_least=True)]
    return table(("what", "points", "p50", "p90", "times faster"), rows), bars


def _under_load(ours: Running, theirs: Running, seconds: float, rounds: int) -> tuple[str, list[Bar]]:
    """Requests a second of a hundred points."""
    asked = _sides(ours, theirs, _STEPS_S[_FEW], round(_FASTEST_PER_S * seconds))
    rows, bars = [], []
    for connections, least in _LEAST.items():
        turns = [
            [apply(running, [each.path for each in questions], connections, seconds) for running, questions in asked]
            for _ in range(rounds)
        ]
        found = [Load.middle(rounds_of_one) for rounds_of_one in zip(*turns, strict=True)]
        more = [each.per_s / found[-1].per_s for each in found]
        both = zip(_NAMES, found, more, strict=True)
        rows += [[name, str(connections), each.per_s, each.p50, each.p99, ratio] for name, each, ratio in both]
        print(f"{connections} connections: {more[0]:.1f} and {more[1]:.1f} times eager torch's rate", flush=True)
        what = f"{_FEW} points, json, {connections} at once: rate over that of the network in eager torch"
        bars.append(Bar(what, more[0], least, at_least=True))
    return table(("what", "connections", "requests/s", "p50", "p99", "times the rate"), rows), bars


def _sides(ours: Running, theirs: Running, dt_s: float, count: int) -> list[Side]:
    """The champion, our server of the network, and theirs, asked the same."""
    query = [urlencode({**scenario, "horizon_s": 10, "dt_s": dt_s}) for scenario in scenarios(count)]
    paper = [Question("GET", f"/v1/predictions?model=viper-lunar-paper&{each}") for each in query]
    plain = [Question("GET", f"/predictions?{each}") for each in query]
    return [(ours, ask_of("json", dt_s, count)), (ours, paper), (theirs, plain)]
