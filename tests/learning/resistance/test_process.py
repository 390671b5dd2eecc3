"""Leaving a run out by formula is the same as fitting without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from service.learning.resistance.hyperparameters import RESISTANCE_KERNEL
from service.learning.resistance.kernels import ScenarioFeatures, scenario_kernels
from service.learning.resistance.process import SolvedProcess, TrainingPoints
from service.learning.resistance.start import fit_start
from service.learning.resistance.tables import TRAVEL_KNOTS_M, time_knots
from tests.learning.resistance.reference import along_time, along_travel, start_shape

RUNS, POINTS = 5, 12


def _points(runs: int) -> tuple[ScenarioFeatures, TrainingPoints]:
    generator = np.random.default_rng(3)
    features = ScenarioFeatures(generator.normal(size=(RUNS, 3))[:runs], generator.uniform(size=RUNS)[:runs])
    time = np.tile(np.linspace(0.1, 6, POINTS), runs)
    values = generator.uniform(size=(3, RUNS * POINTS))[:, : runs * POINTS]
    starts = tuple(range(0, runs * POINTS + 1, POINTS))
    return features, TrainingPoints(
        starts, np.full(runs * POINTS, 0.3), time, 3 * values[0], 0.1 * values[1], 1 + values[2], 1 + 0 * time
    )


def test_the_block_formula_leaves_the_last_run_out():
    knots = time_knots(6.0)
    features, points = _points(RUNS)
    *_, left_out = SolvedProcess(RESISTANCE_KERNEL, features, points, knots).left_out()
    rest = _points(RUNS - 1)
    without = SolvedProcess(RESISTANCE_KERNEL, *rest, knots).tables()
    asked = ScenarioFeatures(features.scaled[-1:], features.gate[-1:])
    by_formula = along_travel(left_out, scenario_kernels(RESISTANCE_KERNEL, asked, features))
    refitted = along_travel(without, scenario_kernels(RESISTANCE_KERNEL, asked, rest[0]))
    np.testing.assert_allclose(by_formula, refitted, atol=1e-7)
    assert np.abs(refitted).max() > 1e-3


def test_without_run_effects_and_noise_the_targets_are_met():
    exact = replace(
        RESISTANCE_KERNEL,
        run_level_deviation=0.0,
        run_travel_deviation=0.0,
        run_release_deviation=0.0,
        run_rut_deviation=0.0,
        run_stall_deviation=0.0,
        noise_deviation=0.0,
        speed_noise_m_s=0.0,
    )
    features, points = _points(2)
    knots = points.time_s[:POINTS]
    tables = SolvedProcess(exact, features, points, knots).tables()
    kernels = scenario_kernels(exact, features, features)
    for run in range(2):
        inside = points.of_run(run)
        travel = along_travel(tables, kernels, run)
        found = np.interp(points.travel_m[inside], TRAVEL_KNOTS_M, travel) + along_time(tables, kernels, run)
        np.testing.assert_allclose(found, points.target[inside], atol=2e-3)


def test_the_start_is_left_out_the_same_way():
    features = np.stack([np.linspace(-1, 1, 7), np.linspace(0, 1, 7) ** 2], axis=-1)
    speed, height = np.sin(features[:, 0]) * 0.1, 0.23 + 0.001 * features[:, 1]
    # Targets that sum up to the left-out one times 7 have the same mean without it.
    speed[3], height[3] = np.delete(speed, 3).mean(), np.delete(height, 3).mean()
    _, without = fit_start(features, speed, height)
    rest = np.arange(7) != 3
    refitted, _ = fit_start(features[rest], speed[rest], height[rest])
    by_formula, truly = (
        process.mean + start_shape(features[3:4], process.features)[0] @ process.weights
        for process in (without[3], refitted)
    )
    np.testing.assert_allclose(by_formula, truly, atol=1e-9)
