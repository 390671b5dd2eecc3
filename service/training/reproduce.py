"""The paper's protocol on our runs: each contestant learns every paper slope but 28 deg and is then asked for 28 deg,
for a rover of twice the mass and torque there, and how long one trajectory takes.

Protocol and published numbers: IAC-23-A3.IP.204, sections 4, 4.1 and 4.2.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from model_store import ModelStore
from service.errors import TrainingError
from service.learning.calibration import calibrate_prior
from service.learning.evaluate import PositionErrors
from service.learning.network.fit import FitProgress
from service.learning.network.fit_config import FitConfig
from service.learning.observed import ObservedRun
from service.learning.split import Split, split_runs, validation_samples
from service.physics.priors import make_prior
from service.physics.scenario import Array, Positions, Scenarios
from service.training.architectures import Announce, Prepared, begin_fit
from service.training.config import ArchitectureName, PriorName, TrainingConfig
from service.training.data import TrainingData, load_training_data

UNSEEN_SLOPE_DEG = 28.0
POINTS = 20_001  # the paper samples 10 s every 0.5 ms
# The paper does not say how long it trained. This takes about half a minute a seed on one core.
FULL_FIT = FitConfig(epochs=100, rows_per_epoch=20_000)
QUICK_FIT = FitConfig(epochs=3, rows_per_epoch=2_000)

Predict = Callable[[Scenarios, Array], Positions]
ShowEpoch = Callable[[FitProgress], None]


@dataclass(frozen=True, slots=True)
class Effort:
    """How often and how long what is random is trained."""

    seeds: int
    fit: FitConfig

    @classmethod
    def of(cls, seeds: int, *, quick: bool) -> Effort:
        """The full effort, or one so short that only the path through the program is tried, not the accuracy."""
        return cls(1, QUICK_FIT) if quick else cls(seeds, FULL_FIT)


@dataclass(frozen=True, slots=True)
class Course:
    """What contestants may learn from (`train`, `space`) and what they are asked for (`unseen`, `heavy`)."""

    data: TrainingData
    train: tuple[ObservedRun, ...]
    space: tuple[ObservedRun, ...]
    unseen: ObservedRun
    heavy: ObservedRun


@dataclass(frozen=True, slots=True)
class Contestant:
    """One row of the table: what learns, over which prior, and whether from the space set as well."""

    key: str
    label: str
    architecture: ArchitectureName
    prior: PriorName
    space: bool = False

    @property
    def random(self) -> bool:
        """Whether a seed changes it: only networks start from random weights."""
        return self.architecture == "paper_network"

    @property
    def learns_from(self) -> str:
        """The runs, in words."""
        return "paper slopes without 28°" + (", and the space set" if self.space else "")


PRINTED_PRIOR, PAPER_NETWORK, OURS = "printed_prior", "paper_network", "drive_model"
CONTESTANTS = (
    Contestant(PRINTED_PRIOR, "printed prior alone", "zero", "rigid_slope"),
    Contestant("motor_prior", "motor prior alone", "zero", "motor_slope"),
    Contestant(PAPER_NETWORK, "paper's network over the printed prior", "paper_network", "rigid_slope"),
    Contestant("network_over_motor", "paper's network over the motor prior", "paper_network", "motor_slope"),
    Contestant(OURS, "our model", "drive_model", "motor_slope"),
    Contestant("drive_model_space", "our model", "drive_model", "motor_slope", space=True),
)


@dataclass(frozen=True, slots=True)
class Trial:
    """One contestant trained once: where it says the wheel goes, and how far off that is."""

    seed: int
    unseen: Positions
    heavy: Positions
    unseen_errors: PositionErrors
    heavy_errors: PositionErrors
    validation_rms_m: float


@dataclass(frozen=True, slots=True)
class Row:
    """All trials of one contestant, by seed, and the time of one trajectory, which no seed changes."""

    contestant: Contestant
    trials: tuple[Trial, ...]
    compute_ms: float

    @property
    def typical(self) -> Trial:
        """The trial whose final error at the unseen slope is the (upper) median."""
        return sorted(self.trials, key=lambda trial: trial.unseen_errors.final_m)[len(self.trials) // 2]

    def values(self, of: Callable[[Trial], float]) -> list[float]:
        """One number of each trial."""
        return [of(trial) for trial in self.trials]


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Everything that the page and the figures are made from."""

    course: Course
    effort: Effort
    rows: tuple[Row, ...]

    def row(self, key: str) -> Row:
        """The row of a contestant. Raises KeyError."""
        return {row.contestant.key: row for row in self.rows}[key]


def reproduce(
    store: ModelStore,
    effort: Effort,
    *,
    announce: Announce = lambda _phase: None,
    show_epoch: ShowEpoch = lambda _reached: None,
) -> Reproduction:
    """Train and judge every contestant, one after the other. Raises TrainingError and what store and datasets raise."""
    announce("loading datasets")
    course, rows = set_course(store), []
    for number, contestant in enumerate(CONTESTANTS, start=1):
        place = f"{number} of {len(CONTESTANTS)}: {contestant.label}, {contestant.learns_from}"
        seeds = range(1, (effort.seeds if contestant.random else 1) + 1)
        trials = []
        for seed in seeds:
            announce(f"{place}, seed {seed} of {len(seeds)}" if contestant.random else place)
            predict = learn(contestant, course, replace(effort.fit, seed=seed), announce, show_epoch)
            trials.append(_judge(predict, course, seed))
        rows.append(Row(contestant, tuple(trials), compute_ms(predict, course.unseen)))
    return Reproduction(course, effort, tuple(rows))


def set_course(store: ModelStore) -> Course:
    """Split the shipped datasets as the paper does.

    Raises TrainingError where the paper or the mass set has not exactly one run at the unseen slope.
    """
    data = load_training_data(store, ["paper", "mass", "space"])
    sets = {name: [run for run in data.runs if run.set_name == name] for name in ("paper", "mass", "space")}
    paper, mass = (split_runs(sets[name], test_slopes_deg=[UNSEEN_SLOPE_DEG]) for name in ("paper", "mass"))
    for name, split in (("paper", paper), ("mass", mass)):
        if len(split.test) != 1:
            raise TrainingError(f"set {name} has {len(split.test)} runs at {UNSEEN_SLOPE_DEG:g} deg, needed is one")
    return Course(data, paper.train, tuple(sets["space"]), paper.test[0], mass.test[0])


def learn(
    contestant: Contestant,
    course: Course,
    fit: FitConfig,
    announce: Announce = lambda _phase: None,
    show_epoch: ShowEpoch = lambda _reached: None,
) -> Predict:
    """What the contestant predicts after training as the paper does: its network sees time and slope alone."""
    config = TrainingConfig(
        model="reproduction",
        datasets=["paper", "space"] if contestant.space else ["paper"],
        architecture=contestant.architecture,
        prior=contestant.prior,
        inputs=["time_s", "slope_deg"],
        x_form="position",
        test_slopes_deg=[UNSEEN_SLOPE_DEG],
        fit=fit,
    )
    runs = course.train + (course.space if contestant.space else ())
    prior = calibrate_prior(make_prior(contestant.prior, 0.0, course.data.rover, course.data.regolith), runs)
    fitting = begin_fit(Prepared(config, course.data, Split(runs, ()), prior), announce=announce)
    for reached in fitting.epochs():
        show_epoch(reached)
    return fitting.finish().model.positions


def _judge(predict: Predict, course: Course, seed: int) -> Trial:
    unseen = predict(course.unseen.scenario, course.unseen.time_s)
    heavy = predict(course.heavy.scenario, course.heavy.time_s)
    return Trial(
        seed,
        unseen,
        heavy,
        PositionErrors.between(unseen, course.unseen),
        PositionErrors.between(heavy, course.heavy),
        validation_rms_m(predict, course.train),
    )


def validation_rms_m(predict: Predict, runs: Sequence[ObservedRun]) -> float:
    """Root of the paper's loss, equation (4), over every fourth sample of the runs, m.

    Their neighbours 0.5 ms away were trained on: this is the paper's validation, and it leaks.
    """
    squares = [
        PositionErrors.between(predict(samples.scenario, samples.time_s), samples).rmse_m ** 2
        for samples in map(validation_samples, runs)
    ]
    return float(np.sqrt(np.mean(squares)))


def compute_ms(predict: Predict, run: ObservedRun, repeats: int = 15) -> float:
    """Median time of one trajectory of 20,001 points over the run's horizon, on one thread, ms."""
    times, spent = np.linspace(0.0, run.horizon_s, POINTS), []
    with threadpool_limits(1, user_api="blas"):
        for _ in range(repeats):
            started = time.perf_counter()
            predict(run.scenario, times)
            spent.append(time.perf_counter() - started)
    return 1e3 * statistics.median(spent)


COLUMNS = (
    "what",
    "trained on",
    "28° final, cm",
    "28° maximum, cm",
    "860 kg final, cm",
    "860 kg maximum, cm",
    "every 4th point, cm rms (leaks)",
    "one trajectory, ms",
)
# What the paper's text says; empty where it says nothing. Errors at 28 deg: section 4.1; 860 kg: section 4.2.
PUBLISHED = (
    ("the paper: prior alone", "12 slopes", "190", "", "", "", "", ""),
    ("the paper: with its network", "12 slopes", "6.1", "", "“pretty similar”", "", "", "120 (Quadro RTX 3000)"),
)


def table(reproduction: Reproduction) -> list[tuple[str, ...]]:
    """The cells under `COLUMNS`: ours, then the published ones. Medians over seeds with their range."""
    return [_cells(row) for row in reproduction.rows] + list(PUBLISHED)


def _cells(row: Row) -> tuple[str, ...]:
    errors: tuple[Callable[[Trial], float], ...] = (
        lambda trial: trial.unseen_errors.final_m,
        lambda trial: trial.unseen_errors.maximum_m,
        lambda trial: trial.heavy_errors.final_m,
        lambda trial: trial.heavy_errors.maximum_m,
        lambda trial: trial.validation_rms_m,
    )
    cells = (_spread_cm(row.values(of)) for of in errors)
    return row.contestant.label, row.contestant.learns_from, *cells, _short(row.compute_ms)


def _spread_cm(values_m: Sequence[float]) -> str:
    """Median and range in cm."""
    low, middle, high = (_short(100 * of(values_m)) for of in (min, statistics.median, max))
    return middle if low == high else f"{middle} ({low} to {high})"


def _short(value: float) -> str:
    """Three digits, or all before the point where there are more."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
