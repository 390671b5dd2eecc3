"""One answer at a time: each form beside the same bytes precomputed and beside the arithmetic alone."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass

from tests.benchmarks.client import Question, inference, scenarios, single
from tests.benchmarks.compute import STEPS_S
from tests.benchmarks.floors import keep_answer
from tests.benchmarks.processes import Running
from tests.benchmarks.report import Bar, Sample, table

FORMS = ("json", "csv", "npz", "arrow", "usda", "V2 json", "V2 binary")
_ALL_AT = 20_001
LIMITS = {"json": 3.0, "csv": 4.0, "npz": 2.5, "arrow": 2.0, "usda": 5.0, "V2 binary": 2.0}
"""Bars of p50 over floor (a)."""
Side = tuple[Running, Sequence[Question]]
WARM_UP = 5
"""Requests of each kind that are not measured."""


def ask_of(form: str, dt_s: float, count: int) -> list[Question]:
    """Questions for one form, each about another scenario."""
    if form.startswith("V2"):
        return [inference(dt_s, [scenario], binary=form == "V2 binary") for scenario in scenarios(count)]
    return [single(form, dt_s, scenario) for scenario in scenarios(count)]


def in_turns(sides: Sequence[Side], repeats: int) -> list[Sample]:
    """Ask all sides in turn, so that whatever else the machine does hits all of them alike."""
    with ExitStack() as stack:
        connections = [stack.enter_context(server.connect()) for server, _ in sides]
        raw = [[each.raw(to.host) for each in asked] for to, (_, asked) in zip(connections, sides, strict=True)]
        taken: list[list[float]] = [[] for _ in sides]
        for number in range(repeats + WARM_UP):
            for connection, requests, times in zip(connections, raw, taken, strict=True):
                began = time.perf_counter()
                status, _, _ = connection.exchange(requests[number % len(requests)])
                times.append((time.perf_counter() - began) * 1e3)
                if status not in (200, 304):
                    raise RuntimeError(f"{requests[number % len(requests)][:200]!r} was answered with a {status}")
    return [Sample(times[WARM_UP:]) for times in taken]


@dataclass(frozen=True, slots=True)
class Beside:
    """An answer of the service and the same bytes from floor (a); processor times of the servers per request, ms."""

    size: int
    service: Sample
    floor: Sample
    service_cpu: float
    floor_cpu: float

    @property
    def ratio(self) -> float:
        """Of the medians."""
        return self.service.p50 / self.floor.p50

    def cells(self) -> list[object]:
        """The last columns of its row."""
        both = [self.service.p50, self.service.p90, self.floor.p50, self.floor.p90]
        return [*both, f"{self.ratio:.2f}", self.service_cpu, self.floor_cpu]


def beside_floor(service: Running, floors: Running, name: str, questions: Sequence[Question], repeats: int) -> Beside:
    """Measure one form."""
    with service.connect() as asked, floors.connect() as kept:
        answer = asked.ask(questions[0])
        path = keep_answer(kept, name, answer)
    same = [Question(each.method, path, each.headers, each.body) for each in questions]
    return _beside(len(answer.body), (service, questions), (floors, same), repeats)


def _beside(size: int, ours: Side, floor: Side, repeats: int) -> Beside:
    before = ours[0].cpu_ms(), floor[0].cpu_ms()
    taken = in_turns([ours, floor], repeats)
    after = ours[0].cpu_ms(), floor[0].cpu_ms()
    return Beside(size, *taken, *((now - then) / (repeats + WARM_UP) for now, then in zip(after, before, strict=True)))


def measure(
    service: Running, floors: Running, alone: Mapping[str, Sequence[float]], repeats: int
) -> tuple[str, list[Bar]]:
    """The table, and the bars of 20,001 points."""
    rows, bars = [], []
    for points, dt_s in STEPS_S.items():
        for form in FORMS:
            questions = ask_of(form, dt_s, repeats + WARM_UP)
            found = beside_floor(service, floors, f"{form.replace(' ', '-')}-{points}", questions, repeats)
            rows.append([f"{points:,}", form, found.size, *_alone(alone, form, points), *found.cells()])
            print(f"{points} {form}: {found.service.p50:.3f} ms, {found.ratio:.2f} x floor (a)", flush=True)
            if points == _ALL_AT and form in LIMITS:
                bars.append(Bar(f"20,001 points, {form}: p50 over floor (a)", found.ratio, LIMITS[form]))
    rows.insert(len(FORMS), _known(service, floors, repeats))
    names = ["points", "form", "bytes", "arithmetic (c)", "encoder", "p50", "p90", "floor (a) p50", "p90", "ratio"]
    text = (
        "### One answer at a time\n\nOne kept connection, ms. *Arithmetic* is the twin's `predict` in a process "
        "without a server, *encoder* the writing of the bytes there; the rest of p50 is HTTP. *Ratio* is p50 over "
        "floor (a), *CPU* the processor time per request of either server. *304* is the answer to a client that has "
        "it, beside floor (b).\n\n"
    )
    return text + table([*names, "CPU", "floor's CPU"], rows), bars


def _known(service: Running, floors: Running, repeats: int) -> list[object]:
    """The row of an answer that the client has already: all that a request costs but arithmetic and bytes."""
    asked = ask_of("json", STEPS_S[201], repeats + WARM_UP)
    with service.connect() as connection:
        tags = [connection.ask(question).headers["etag"] for question in asked]
    again = [Question("GET", each.path, {"If-None-Match": tag}) for each, tag in zip(asked, tags, strict=True)]
    found = _beside(0, (service, again), (floors, [Question("GET", "/tiny")]), repeats)
    print(f"304: {found.service.p50:.3f} ms, {found.ratio:.2f} x floor (b)", flush=True)
    return ["201", "304", 0, "", "", *found.cells()]


def _alone(alone: Mapping[str, Sequence[float]], form: str, points: int) -> tuple[object, object]:
    encoder = alone.get(f"{form} {points}")
    return Sample(alone[f"predict {points}"]).p50, Sample(encoder).p50 if encoder else ""
