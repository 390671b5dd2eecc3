"""The service beside the afternoon's solution: `tests.benchmarks.eager`, the paper's network in eager torch."""

from __future__ import annotations

from urllib.parse import urlencode

from tests.benchmarks.client import Question, scenarios
from tests.benchmarks.compute import STEPS_S
from tests.benchmarks.latency import WARM_UP, ask_of, in_turns
from tests.benchmarks.processes import server, service
from tests.benchmarks.report import Bar, table

_POINTS = 20_001


def measure(repeats: int) -> tuple[str, list[Bar]]:
    """The table and its bar, from servers of their own: the paper's network brings torch into the process."""
    dt_s = STEPS_S[_POINTS]
    query = [urlencode({**scenario, "horizon_s": 10, "dt_s": dt_s}) for scenario in scenarios(repeats + WARM_UP)]
    paper = [Question("GET", f"/v1/predictions?model=viper-lunar-paper&{each}") for each in query]
    plain = [Question("GET", f"/predictions?{each}") for each in query]
    with service() as ours, server("eager") as theirs:
        sides = [(ours, ask_of("json", dt_s, repeats + WARM_UP)), (ours, paper), (theirs, plain)]
        taken = in_turns(sides, repeats)
    faster = [taken[-1].p50 / each.p50 for each in taken]
    names = ("the service", "the service with the same network", "eager torch in a plain FastAPI route")
    rows = [[name, each.p50, each.p90, ratio] for name, each, ratio in zip(names, taken, faster, strict=True)]
    print(f"{faster[0]:.1f} times faster than eager torch", flush=True)
    text = (
        "### Against eager torch\n\nThe paper's network (five layers, 30 to 500 wide) in eager PyTorch behind a "
        "FastAPI route that returns lists: 20,001 points in JSON, ms.\n\n"
    )
    bar = Bar("20,001 points, json: times faster than the paper's network in eager torch", faster[0], 10, at_least=True)
    return text + table(("what", "p50", "p90", "times faster"), rows), [bar]
