"""Drives over a loopback connection, and where their time goes: `python -m tests.benchmarks.drives [repeats]`.

A drive of 20 s and 401 points in JSON: over a track whose slope changes under controls that change, with a brake, and
over a constant slope with a constant torque. Beside it the prediction of the same points, which has one drive of the
engine where a drive has two.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable

from tests.benchmarks.client import Question
from tests.benchmarks.compute import times_ms
from tests.benchmarks.latency import WARM_UP, in_turns
from tests.benchmarks.processes import Running, service
from tests.benchmarks.report import Sample, table

GOAL_MS = 1.5
_TRACK = {"distance_m": [0, 3, 6, 9], "slope_deg": [10, 22, 18, 12]}
_BRAKED = {"time_s": [0, 8, 10], "torque_nm": [60, 0, 80], "brake": [False, True, False]}


def drive(slope_deg: float | None = None) -> Question:
    """A drive: with a slope a constant one."""
    varying = {"mass_kg": 430, "track": _TRACK, "controls": _BRAKED}
    constant = {"mass_kg": 430, "track": {"distance_m": [0], "slope_deg": [slope_deg]}, "controls": 60}
    body = json.dumps(varying if slope_deg is None else constant).encode()
    return Question("POST", "/v1/drives", {"Content-Type": "application/json"}, body)


QUESTIONS = {
    "drive, all changes": drive(),
    "drive, constant": drive(20.0),
    "prediction": Question("GET", "/v1/predictions?slope_deg=20&mass_kg=430&torque_nm=60&horizon_s=20"),
}


def over_loopback(running: Running, repeats: int) -> list[list[object]]:
    """A row for each question: p50 and p90, and processor time of the server, ms."""
    rows: list[list[object]] = []
    for name, question in QUESTIONS.items():
        before = running.cpu_ms()
        (taken,) = in_turns([(running, [question])], repeats)
        cpu = (running.cpu_ms() - before) / (repeats + WARM_UP)
        rows.append([name, taken.p50, taken.p90, cpu])
    return rows


def parts(repeats: int) -> list[list[object]]:
    """A row for each part of a drive's answer, without a server: the fastest of all and p50, ms."""
    from model_store import ModelStore
    from service.settings import Settings
    from service.twin import Loaded
    from service.twin.drives.question import driver_of
    from service.twin.drives.way import Rover, own_times
    from service.twin.load import load_twin
    from service.wire.drives.ask import driven
    from service.wire.drives.question import DriveBody
    from service.wire.forms.json import encode_json

    store = ModelStore.open(Settings().store_url)
    resolved = store.resolve("viper-lunar")
    loaded = Loaded(load_twin(store, resolved.name, resolved.version), resolved.alias)
    body = QUESTIONS["drive, all changes"].body
    question, wanted = DriveBody.model_validate_json(body, strict=True).asked(100_000)
    subject = driven(question, wanted, False, loaded)
    rover, times = Rover.of(driver_of(loaded.twin), question), own_times(question)
    calls: dict[str, Callable[[int], object]] = {
        "reading": lambda _: DriveBody.model_validate_json(body, strict=True).asked(100_000),
        "the engine, once": lambda _: rover.at(times),
        "the whole drive": lambda _: driven(question, wanted, False, loaded),
        "writing": lambda _: encode_json(subject),
    }
    measured = {name: times_ms(call, repeats) for name, call in calls.items()}
    return [[name, min(taken), Sample(taken).p50] for name, taken in measured.items()]


def main() -> None:
    """Print both tables."""
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    with service() as running:
        found = over_loopback(running, repeats)
    print(table(["20 s, 401 points, JSON", "p50 ms", "p90 ms", "CPU ms"], found))
    print(f"\nThe goal of a drive is a p50 of {GOAL_MS:g} ms.\n")
    print(table(["part", "fastest ms", "p50 ms"], parts(repeats)))


if __name__ == "__main__":
    main()
