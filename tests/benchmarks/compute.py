"""Floor (c), the arithmetic alone: no server, no bytes. `python -m tests.benchmarks.compute` prints JSON.

The engine alone (trajectories, a drive, a step of many rovers), and the twin's `predict`, which adds summary and
verdict. Beside it each encoder alone, so that a request can be taken apart: arithmetic, bytes, and the rest, which is
HTTP.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from tests.benchmarks.client import scenarios
from tests.benchmarks.machine import SERVER_CPU, python, running_on
from tests.benchmarks.report import Bar, Sample, table

if TYPE_CHECKING:
    from service.learning.drive.model import DriveModel

STEPS_S = {201: 0.05, 2_001: 0.005, 20_001: 0.0005}
BATCH = 1000
MAP = 64  # slopes, and torques
DRIVE_S, DRIVE_POINTS = 20.0, 401
STEP_S = 0.1


def measured(repeats: int) -> dict[str, list[float]]:
    """Times (ms) by name, from a process of its own on the server's processor."""
    with running_on(SERVER_CPU):
        command = python("tests.benchmarks.compute", str(repeats))
        done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout))


def described(alone: Mapping[str, Sequence[float]]) -> tuple[str, list[Bar]]:
    """The tables, and the bars of the engine alone."""
    kinds = ("engine", "predict")
    rows = [[f"{points:,}", *(Sample(alone[f"{kind} {points}"]).p50 for kind in kinds)] for points in STEPS_S]
    text = (
        "### Arithmetic\n\nOne trajectory in a process without a server, median, ms: the compiled engine alone, "
        "and with summary and domain verdict (floor (c) below).\n\n"
    )
    together = Sample(alone["engine_many"]).p50
    other = (
        f"\n\nThe engine alone on a drive of {DRIVE_S:g} s at {DRIVE_POINTS} times, over slopes and under torques that "
        f"change: {Sample(alone['drive']).p50:.3g} ms. One step of {STEP_S:g} s of {BATCH:,} rovers: "
        f"{Sample(alone['step']).p50:.3g} ms. {BATCH:,} constant scenarios of 201 points: {together:.3g} ms."
    )
    bars = [
        Bar(
            f"{BATCH:,} x 201 points, engine alone, scenarios a second", BATCH / together * 1e3, 120_000, at_least=True
        ),
        Bar(f"mobility map of {MAP} x {MAP}, ms", Sample(alone["map"]).p50, 40.0),
        Bar("20,001 points, engine alone, ms", Sample(alone["engine 20001"]).p50, 0.2),
        Bar(f"drive of {DRIVE_S:g} s, {DRIVE_POINTS} points, engine alone, ms", Sample(alone["drive"]).p50, 0.3),
        Bar(f"one step of {BATCH:,} rovers, engine alone, ms", Sample(alone["step"]).p50, 3.0),
    ]
    return text + table(["points", "engine", "prediction (c)"], rows) + other, bars


def times_ms(calls: Callable[[int], object], repeats: int) -> list[float]:
    """How long each of the calls took, after five unmeasured ones; they get their number."""
    taken = []
    for number in range(repeats + 5):
        began = time.perf_counter()
        calls(number)
        taken.append((time.perf_counter() - began) * 1e3)
    return taken[5:]


def main() -> None:
    """Measure and print."""
    import numpy as np

    from model_store import ModelStore
    from service.physics.scenario import Scenarios
    from service.settings import load_settings
    from service.twin import Loaded, Scenario, sample_times
    from service.twin.load import load_twin
    from service.twin.mobility import mobility_map
    from service.wire.forms import ENCODERS, Format, Subject

    repeats = int(sys.argv[1])
    store = ModelStore.open(load_settings().store_url)
    resolved = store.resolve("viper-lunar")
    twin = load_twin(store, resolved.name, resolved.version)
    asked = [Scenario(**scenario, horizon_s=10.0) for scenario in scenarios(BATCH)]
    found: dict[str, list[float]] = {}
    physics = [scenario.as_physics() for scenario in asked]
    many = Scenarios.stack(physics)
    for points, dt_s in STEPS_S.items():
        grid = sample_times(10.0, dt_s)
        found[f"engine {points}"] = times_ms(lambda n, g=grid: twin.model.positions(physics[n % BATCH], g), repeats)
        found[f"predict {points}"] = times_ms(lambda n, grid=grid: twin.predict(asked[n % BATCH], grid), repeats)
        subject = Subject(Loaded(twin, resolved.alias), twin.predict(asked[0], grid))
        for form in (Format.JSON, Format.CSV, Format.NPZ, Format.ARROW, Format.USDA):
            encode = ENCODERS[form].encode
            found[f"{form} {points}"] = times_ms(lambda _, e=encode, s=subject: e(s), repeats)
    grid = sample_times(10.0, STEPS_S[201])
    found["engine_many"] = times_ms(lambda _: twin.model.positions(many, grid), max(5, repeats // 10))
    found["predict_many"] = times_ms(lambda _: twin.predict_many(asked, grid), max(5, repeats // 10))
    torques, slopes = np.linspace(10.0, 125.0, MAP), np.linspace(-10.0, 30.0, MAP)
    found["map"] = times_ms(lambda _: mobility_map(twin, 430.0, torques, slopes, 10.0, 0.9), max(5, repeats // 20))
    print(json.dumps(found | drives(twin.model, repeats)))


def drives(model: DriveModel, repeats: int) -> dict[str, list[float]]:
    """Times (ms) of a drive and of a step of many rovers on their way, by the engine alone."""
    import numpy as np

    from service.learning.drive.inputs import Controls, Track

    track = Track(np.array([0.0, 2.0, 4.0, 6.0]), np.radians([5.0, 20.0, 12.0, 18.0]))
    controls = Controls(np.array([0.0, 6.0, 9.0]), np.array([60.0, 90.0, 70.0]), np.zeros(3, dtype=np.bool_))
    start, times = model.engine.start(430.0), np.linspace(0.0, DRIVE_S, DRIVE_POINTS)
    slopes, torques = np.radians(np.linspace(0.0, 25.0, BATCH)), np.linspace(40.0, 120.0, BATCH)
    moving, _ = model.engine.step([start] * BATCH, slopes, torques, False, 2.0)
    return {
        "drive": times_ms(lambda _: model.engine.drive(start, track, controls, times), repeats),
        "step": times_ms(lambda _: model.engine.step(moving, slopes, torques, False, STEP_S), repeats),
    }


if __name__ == "__main__":
    main()
