"""Fitting a drive model to runs: bases, start speeds, the law (`gauss_newton`), heights, and each run left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from service.learning.drive.bases import bases_of, reach_of
from service.learning.drive.engine import Engine
from service.learning.drive.gauss_newton import Problem, minimise, without_each
from service.learning.drive.height import fit_heights
from service.learning.drive.law import PARAMETERS, Law
from service.learning.drive.model import DriveModel
from service.learning.drive.observations import Observation, observe_all
from service.learning.drive.priors import Whitening, parameters_of
from service.learning.drive.start import StartSpeeds
from service.learning.observed import ObservedRun
from service.physics.prior import Prior
from service.physics.scenario import Array, Positions

_FORCED_STEPS, _WHOLE_STEPS = 8, 12
_THREADS = 2

Progress = Callable[[str], None]
Check = Callable[[], None]


@dataclass(frozen=True, slots=True, eq=False)
class FittedDrive:
    """The model of all runs and, by name, what one that was fitted without a run says of it, at the run's times."""

    model: DriveModel
    left_out: Mapping[str, Positions]
    left_out_models: Mapping[str, DriveModel]


def fit_drive(
    runs: Sequence[ObservedRun],
    prior: Prior,
    *,
    progress: Progress = lambda _phase: None,
    check: Check = lambda: None,
    threads: int = _THREADS,
) -> FittedDrive:
    """Fit to runs, whose slope, torque and brake may change. Deterministic, and the same for any number of threads.

    `progress` hears of phases, `check` is called every second or so; both may raise to stop it. Raises ValueError
    without runs and for one that is too short.
    """
    if not runs:
        raise ValueError("a drive model cannot be fitted without runs")
    rover, regolith = prior.rover, prior.regolith
    observed = observe_all(runs, rover)
    motion, stall = bases_of(observed, rover, regolith)
    whitening = Whitening.of(motion, stall)
    count = 2 * len(motion) + len(stall)
    blank = Law(rover, regolith, parameters_of(np.zeros(len(PARAMETERS))), motion, stall, np.zeros(count))
    blank = replace(blank, reach=reach_of(observed, rover, regolith))

    def tell(words: str) -> Callable[[int, float], None]:
        def heard(step: int, cost: float) -> None:
            check()
            progress(f"{words}, step {step + 1}: cost {cost:.1f}")

        return heard

    y = np.zeros(len(PARAMETERS) + count)
    forced = Problem(blank, whitening, observed, threads, forced=True)
    y = minimise(forced, y, _FORCED_STEPS, tell("fitting, runs in pieces"))
    whole = Problem(blank, whitening, observed, threads)
    y = minimise(whole, y, _WHOLE_STEPS, tell("fitting, whole runs"))
    check()
    starts = StartSpeeds.of(runs)
    model = _model(prior, whole, blank, y, starts, runs, observed)
    progress("leaving out one run at a time")
    models: dict[str, DriveModel] = {}
    for run, numbers in zip(runs, without_each(whole, y), strict=True):
        check()
        others = [each for each in runs if each is not run] or [run]
        law = _with_numbers(model.law, whole, numbers)
        models[run.name] = replace(model, law=law, starts=StartSpeeds.of(others))
    return FittedDrive(model, {run.name: models[run.name].drive_run(run) for run in runs}, models)


def _with_numbers(law: Law, problem: Problem, y: Array) -> Law:
    parameters, weights = problem.numbers(y[None])
    return replace(law, parameters=parameters[0], weights=weights[0])


def _model(
    prior: Prior,
    problem: Problem,
    blank: Law,
    y: Array,
    starts: StartSpeeds,
    runs: Sequence[ObservedRun],
    observed: Sequence[Observation],
) -> DriveModel:
    law = _with_numbers(blank, problem, y)
    heights = fit_heights(Engine(law), runs, observed)
    return DriveModel(prior, replace(law, heights=heights), starts)
