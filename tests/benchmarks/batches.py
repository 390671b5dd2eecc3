"""A thousand scenarios in one request beside the same thousand one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tests.benchmarks.client import Question, batch, inference, scenarios
from tests.benchmarks.compute import BATCH, STEPS_S
from tests.benchmarks.latency import beside_floor
from tests.benchmarks.load import CONCURRENCY, apply, paths_of
from tests.benchmarks.processes import Running
from tests.benchmarks.report import Bar, Sample, table

_POINTS = 201
FORMS = ("arrow", "npz", "ndjson", "json", "V2 binary")


def measure(
    service: Running, floors: Running, alone: Mapping[str, Sequence[float]], repeats: int, seconds: float
) -> tuple[str, list[Bar]]:
    """The table of batches and its bar, which is against single requests at their best."""
    dt_s = STEPS_S[_POINTS]
    singles = {
        count: apply(service, paths_of("arrow", dt_s, seconds), count, seconds).per_s
        for count in (CONCURRENCY[0], CONCURRENCY[-1])
    }
    rows: list[list[object]] = [
        [f"single, arrow, {count} at once", "", "", "", "", "", per_s, 1.0 if per_s == max(singles.values()) else ""]
        for count, per_s in singles.items()
    ]
    best, bars = max(singles.values()), []
    for form in FORMS:
        found = beside_floor(
            service, floors, f"batch-{form.replace(' ', '-')}", [_question(form, dt_s) for _ in range(5)], repeats
        )
        took, least, per_s = found.service, found.floor, BATCH / found.service.p50 * 1e3
        rows.append([f"batch, {form}", found.size, took.p50, took.p90, least.p50, found.ratio, per_s, per_s / best])
        print(f"batch {form}: {took.p50:.1f} ms, {per_s / best:.1f} times single", flush=True)
        if form == "arrow":
            what = f"{BATCH:,} scenarios of {_POINTS} points, arrow: scenarios per second over single requests"
            bars.append(Bar(what, per_s / best, 50, at_least=True))
    arithmetic = Sample(alone["predict_many"])
    rows.append(["arithmetic alone (c)", "", arithmetic.p50, arithmetic.p90, "", "", BATCH / arithmetic.p50 * 1e3, ""])
    names = ("what", "bytes", "p50", "p90", "floor (a) p50", "ratio", "scenarios/s", "times single")
    text = f"### Batches\n\n{BATCH:,} scenarios of {_POINTS} points in one request, ms.\n\n"
    return text + table(names, rows), bars


def _question(form: str, dt_s: float) -> Question:
    asked = scenarios(BATCH)
    return inference(dt_s, asked, binary=True) if form == "V2 binary" else batch(form, dt_s, asked)
