"""Left-out predictions for unit tests: the truth plus errors that are drawn, so that their law is known."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from service.learning.band import Band
from service.learning.domain import Domain
from service.learning.observed import ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Positions, Scenarios
from tests.learning.synthetic import synthetic_runs


def left_out(runs: Sequence[ObservedRun], seed: int = 0, spread: float = 1.0) -> dict[str, Positions]:
    """Errors that grow and waver with time: about 1 cm in x and 1 mm in y, times a lognormal factor for each run."""
    draws = np.random.default_rng(seed).lognormal(0.0, spread, len(runs)) if spread else np.ones(len(runs))
    return {run.name: _off(run, float(factor)) for run, factor in zip(runs, draws, strict=True)}


def _off(run: ObservedRun, factor: float) -> Positions:
    share = run.time_s / run.horizon_s
    grown = factor * share * (1 + 0.8 * np.sin(12 * share))
    return Positions((run.x_m + 0.01 * grown)[None], (run.y_m - 0.001 * (0.1 * factor + grown))[None])


def domain_of(runs: Sequence[ObservedRun]) -> Domain:
    return Domain.of_runs(runs, VIPER, LUNAR_REGOLITH, {run.name: 0.01 for run in runs[1:]})


def synthetic_band(spread: float = 1.0) -> Band:
    runs = synthetic_runs()
    return Band.calibrate(runs, left_out(runs, spread=spread), domain_of(runs))


def random_runs(count: int, seed: int) -> list[ObservedRun]:
    """Runs all over slope, mass and torque that drive at a speed of their own."""
    rng, time = np.random.default_rng(seed), np.linspace(0, 4, 41)
    columns = zip(rng.uniform(0, 30, count), rng.uniform(300, 900, count), rng.uniform(30, 130, count), strict=True)
    return [
        ObservedRun(f"r{at}", "unit", Scenarios.of(*each), time, (0.5 - each[0] / 60) * time, 0.2 + 0.01 * time)
        for at, each in enumerate(columns)
    ]
