"""Vectors, sweeps and height features say what drives say."""

from __future__ import annotations

import numpy as np
import pytest

from service.learning.drive import law as law_module
from service.learning.drive.engine import Engine
from service.learning.drive.law import Law
from service.learning.drive.library import vector_bits
from service.learning.drive.sweep import Sweep, SweptRun
from tests.learning.drive.test_hostile import CONTROLS, TRACK

TIMES = np.linspace(0.0, 10.0, 2001)


@pytest.mark.parametrize("bits", [128, 256])
def test_answers_do_not_depend_on_the_processor(law: Law, bits: int, monkeypatch: pytest.MonkeyPatch):
    if bits > vector_bits():
        pytest.skip("this machine has no such vectors")
    widest, _ = Engine(law).drive(Engine(law).start(430.0), TRACK, CONTROLS, TIMES)
    monkeypatch.setattr(law_module, "vector_bits", lambda: bits)
    narrow, _ = Engine(law).drive(Engine(law).start(430.0), TRACK, CONTROLS, TIMES)
    for name in ("x_m", "speed_m_s", "front_wheel_rad_s", "rear_wheel_rad_s", "y_m", "slope_rad"):
        np.testing.assert_array_equal(getattr(narrow, name), getattr(widest, name))


def test_a_sweep_is_many_drives(law: Law):
    rng = np.random.default_rng(0)
    rows = law.parameters * rng.normal(1, 0.01, (5, len(law.parameters)))
    weights = law.weights + rng.normal(0, 0.01, (5, len(law.weights)))
    times = [np.linspace(0, 5, 21), np.linspace(0, 8, 33)]
    runs = [
        SweptRun(mass, 0.1, TRACK, CONTROLS, t, t * 0.1, t * 0 + 0.1)
        for mass, t in zip((430.0, 800.0), times, strict=True)
    ]
    sweep = Sweep(law, runs)
    found = sweep(rows, weights)
    for row in range(5):
        engine = Engine(Law(law.rover, law.regolith, rows[row], law.motion, law.stall, weights[row]))
        for i, run in enumerate(runs):
            motion, _ = engine.drive(engine.start(run.mass_kg, 0.1), TRACK, CONTROLS, run.time_s)
            columns = motion.x_m, motion.speed_m_s, motion.front_wheel_rad_s, motion.rear_wheel_rad_s
            for got, wanted in zip(found, columns, strict=True):
                np.testing.assert_array_equal(got[row, sweep.offsets[i] : sweep.offsets[i + 1]], wanted)
    np.testing.assert_array_equal(found, sweep(rows, weights, threads=1))


def test_forced_runs_go_on_from_what_was_observed(law: Law):
    times = np.linspace(0, 8, 33)
    engine = Engine(law)
    truth, _ = engine.drive(engine.start(430.0), TRACK, CONTROLS, times)
    run = SweptRun(430.0, 0.0, TRACK, CONTROLS, times, truth.x_m, truth.speed_m_s)
    x, *_ = Sweep(law, [run], force_every=4)(law.parameters[None], law.weights[None])
    np.testing.assert_allclose(x[0], truth.x_m, atol=1e-9)
    off = SweptRun(430.0, 0.0, TRACK, CONTROLS, times, truth.x_m + 1.0, truth.speed_m_s)
    x, *_ = Sweep(law, [off], force_every=4)(law.parameters[None], law.weights[None])
    assert x[0, 4] == truth.x_m[4]  # recorded before it is forced
    assert abs(x[0, 5] - truth.x_m[5] - 1.0) < 0.1


def test_height_features_make_the_height(law: Law):
    engine = Engine(law)
    start = engine.start(430.0)
    motion, _ = engine.drive(start, TRACK, CONTROLS, TIMES[::20])
    features = engine.height_features(start, TRACK, CONTROLS, TIMES[::20])
    np.testing.assert_allclose(features @ law.heights, motion.y_m, atol=1e-12)


def test_times_in_any_order_have_the_motion_of_sorted_ones(law: Law):
    engine, times = Engine(law), np.linspace(0.0, 12.0, 61)
    orders = np.array([np.random.default_rng(row).permutation(61) for row in range(3)])
    scenarios = np.radians([5.0, 18.0, 30.0]), np.array([430.0, 550.0, 700.0]), np.full(3, 60.0)
    sorted_ = engine.constant(*scenarios, 0.1, times)
    for mixed, rows in ((times[orders[0]], orders[[0, 0, 0]]), (times[orders], orders)):
        for found, wanted in zip(engine.constant(*scenarios, 0.1, mixed), sorted_, strict=True):
            np.testing.assert_array_equal(found, np.take_along_axis(wanted, rows, 1))
