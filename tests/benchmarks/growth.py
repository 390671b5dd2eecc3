"""How training and prediction grow with the number of runs: `python -m tests.benchmarks.growth [COUNT ...]`.

Writes its part of docs/performance.md; some twenty minutes for 80, 300 and 1,000 runs, which the shipped champion makes
itself: inside its domain, a quarter of them drives, each with an error of the force balance as large as the scatter of
simulations. Training goes the whole way of `rover-twin train`, from runs in memory to a stored version.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from model_store import ModelStore
from service.cpu import limit_compute_threads
from service.learning.calibration import calibrate_prior
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.model import DriveModel
from service.learning.observed import Controls as ObservedControls
from service.learning.observed import ObservedRun
from service.learning.split import Split
from service.learning.suggest_drives import Change, SuggestedDrive
from service.physics.scenario import Array, Scenarios
from service.settings import load_settings
from service.training.architectures import Prepared, begin_fit
from service.training.config import TrainingConfig
from service.training.data import TrainingData
from service.training.train import evaluate_fitted, publish_trained
from service.twin import Scenario, Twin, sample_times
from service.twin.load import load_twin
from tests.benchmarks.machine import described
from tests.benchmarks.report import Bar, Sample, bars_table, table, write_part

COUNTS = (80, 300, 1000)
THREADS, SEED = 2, 1
MOST_MINUTES, MOST_TIMES = 20.0, 2.0
_ROWS_S, _RUN_S, _DRIVE_S = 0.005, 10.0, 20.0
_SCATTER = 0.0005  # of the weight: docs/fidelity.md, between its smallest and its largest
_DRIVES = 0.25  # of all runs
_QUESTIONS, _POINTS_S = 400, 0.05


def scenarios_inside(twin: Twin, seed: int) -> Iterator[tuple[float, float, float]]:
    """Slope (deg), mass (kg) and torque (N m), at random inside the domain."""
    random, spans = np.random.default_rng(seed), twin.domain.spans
    while True:
        slope, mass, torque = (random.uniform(*spans[name]) for name in ("slope_deg", "mass_kg", "torque_nm"))
        if twin.domain.judge(slope, mass, torque, _RUN_S).inside:
            yield slope, mass, torque


def made_runs(twin: Twin, count: int, seed: int = SEED) -> list[ObservedRun]:
    """Runs from rest that the twin's model makes; more of them begin with the same ones."""
    inside, random = scenarios_inside(twin, seed), np.random.default_rng(seed + 1)
    runs = []
    for row in range(count):
        (slope, mass, torque), (later_slope, _, later_torque) = next(inside), next(inside)
        change = tuple(Change)[random.integers(3)] if random.random() < _DRIVES else None
        drive = SuggestedDrive(change or Change.SLOPE, mass, (slope, slope), (torque, torque), (0.0, 0.0, 0.0))
        if change is Change.SLOPE:
            drive = replace(drive, slope_deg=(slope, later_slope))
        elif change is not None:
            drive = replace(drive, torque_nm=(torque, later_torque))
        offset = float(random.normal(0.0, _SCATTER))
        runs.append(made_run(cast(DriveModel, twin.model), drive, f"made_{row}", offset, varies=change is not None))
    return runs


def made_run(model: DriveModel, drive: SuggestedDrive, name: str, offset: float, *, varies: bool) -> ObservedRun:
    """One run with its wheel speeds and, where it `varies`, what acted on it."""
    times = sample_times(_DRIVE_S if varies else _RUN_S, _ROWS_S)
    track, controls = drive.track(), drive.controls()
    start = model.start(drive.mass_kg, float(track.slope_rad[0]))
    motion, _ = model.engine.drive(start, track, controls, times, offset)
    return ObservedRun(
        name,
        "made",
        Scenarios.of(drive.slope_deg[0], drive.mass_kg, drive.torque_nm[0]),
        times,
        motion.x_m,
        motion.y_m,
        float(0.5 * (motion.rear_wheel_rad_s + motion.front_wheel_rad_s).mean()),
        motion.rear_wheel_rad_s,
        motion.front_wheel_rad_s,
        motion.speed_m_s,
        _acted(track, controls, motion.slope_rad, times) if varies else ObservedControls(),
    )


def _acted(track: Track, controls: Controls, slope_rad: Array, times: Array) -> ObservedControls:
    rows = np.searchsorted(controls.time_s, times, side="right") - 1
    brake = np.asarray(controls.brake)[rows] > 0
    slope = slope_rad if len(track.slope_rad) > 1 else None
    return ObservedControls(slope, controls.torque_nm[rows], brake if brake.any() else None)


@dataclass(slots=True)
class Clock:
    """Wall and processor seconds of each phase; `phase` ends the one before."""

    seconds: dict[str, list[float]] = field(default_factory=dict)
    _name: str = ""
    _since: tuple[float, float] = (0.0, 0.0)

    def phase(self, announced: str) -> None:
        """What comes next; steps of one phase count together."""
        now = time.perf_counter(), time.process_time()
        if self._name:
            spent = self.seconds.setdefault(self._name, [0.0, 0.0])
            for at in range(2):
                spent[at] += now[at] - self._since[at]
        self._name, self._since = announced.split(", step")[0], now

    def total(self) -> tuple[float, float]:
        """Of all phases: wall and processor seconds."""
        wall, processor = np.sum(list(self.seconds.values()), axis=0)
        return float(wall), float(processor)


def trained(twin: Twin, runs: list[ObservedRun]) -> tuple[Twin, Clock]:
    """A twin of these runs, made as `rover-twin train` makes one, and what that took."""
    clock, store, prior = Clock(), ModelStore.open("memory://"), twin.model.prior
    data = TrainingData((), tuple(runs), prior.rover, prior.regolith, "rear wheel", "slope")
    config = TrainingConfig(model="made", datasets=["made"], architecture="drive_model")
    clock.phase("prior")
    prior = calibrate_prior(prior, [run for run in runs if not run.varies])
    prepared = Prepared(config, data, Split(train=tuple(runs), test=()), prior)
    fitted = begin_fit(prepared, announce=clock.phase).finish()
    found = evaluate_fitted(prepared, fitted, clock.phase)
    clock.phase("report and publication")
    manifest = publish_trained(store, config, found, created_by="growth", command="growth")
    clock.phase("done")
    return load_twin(store, "made", manifest.version), clock


def asked(twin: Twin, questions: list[Scenario], level: float | None) -> Sample:
    """One prediction of 201 points after the other, each of another scenario, ms."""
    times, taken = sample_times(_RUN_S, _POINTS_S), []
    for scenario in questions:
        began = time.perf_counter()
        twin.predict(scenario, times, band_level=level)
        taken.append(1e3 * (time.perf_counter() - began))
    return Sample(taken)


def main() -> None:
    """Train on each count, ask all twins in turn, and write the tables."""
    counts = [int(word) for word in sys.argv[1:]] or list(COUNTS)
    limit_compute_threads(THREADS)
    store = ModelStore.open(load_settings().store_url)
    champion = load_twin(store, "viper-lunar", store.alias("viper-lunar", "champion").version)
    runs, twins, clocks, memory = made_runs(champion, max(counts)), {}, {}, {}
    for count in counts:
        twins[count], clocks[count] = trained(champion, runs[:count])
        memory[count] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(count, clocks[count].seconds, f"{memory[count]:.0f} MiB", flush=True)
    inside = scenarios_inside(champion, SEED + 2)
    questions = [Scenario(*next(inside), _RUN_S) for _ in range(_QUESTIONS)]
    taken = {}
    for level in (None, 0.9):
        for twin in twins.values():
            asked(twin, questions[:40], level)  # warm
        taken[level] = {count: asked(twin, questions, level) for count, twin in twins.items()}
    write_part("growth", _page(counts, clocks, memory, taken))


def _page(
    counts: list[int],
    clocks: dict[int, Clock],
    memory: dict[int, float],
    taken: dict[float | None, dict[int, Sample]],
) -> str:
    first, last = counts[0], counts[-1]
    times = {level: taken[level][last].p50 / taken[level][first].p50 for level in taken}
    bars = [
        Bar(f"training on {last:,} runs, minutes", clocks[last].total()[0] / 60, MOST_MINUTES),
        Bar("the same, processor time of all threads, minutes", clocks[last].total()[1] / 60, MOST_MINUTES),
        Bar(f"201 points, {last:,} runs over {first:,}", times[None], MOST_TIMES),
        Bar(f"201 points with a band, {last:,} runs over {first:,}", times[0.9], MOST_TIMES),
    ]
    phases = table(
        ("runs", *clocks[last].seconds, "in all", "processor", "most memory until then, MiB"),
        (
            [
                count,
                *(spent[0] for spent in clocks[count].seconds.values()),
                clocks[count].total()[0],
                clocks[count].total()[1],
                memory[count],
            ]
            for count in counts
        ),
    )
    answers = table(
        ("runs", "p50", "p90", "with a band, p50", "p90"),
        (
            [count, taken[None][count].p50, taken[None][count].p90, taken[0.9][count].p50, taken[0.9][count].p90]
            for count in counts
        ),
    )
    return (
        f"## Growth with the number of runs\n\n`python -m tests.benchmarks.growth`. {described(serving=False)}\n\n"
        "Runs that the champion makes itself: random scenarios inside its domain, a quarter of them drives of 20 s, "
        f"others 10 s, a row every {1e3 * _ROWS_S:g} ms, seeded. Trained with {THREADS} threads as by `rover-twin "
        f"train`, from runs in memory to a stored version.\n\n{bars_table(bars)}\n\n"
        f"### Training\n\nSeconds of each phase; *processor* is that of all threads.\n\n{phases}\n\n"
        f"### One prediction\n\n201 points of a constant scenario in the process, one thread, ms.\n\n{answers}"
    )


if __name__ == "__main__":
    main()
