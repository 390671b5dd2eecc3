"""Physics bounds the motion whatever is asked, and whatever the law's numbers are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.drive.engine import Engine
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.law import PARAMETERS, Law
from service.learning.drive.state import states_array
from service.physics.parameters import LUNAR_REGOLITH, VIPER

GRAVITY = LUNAR_REGOLITH.gravity_m_s2
RIM_SPEED = VIPER.no_load_speed_rad_s * VIPER.wheel_radius_m
TIMES = np.linspace(0.0, 20.0, 401)


def wild(law: Law, rng: np.random.Generator) -> Law:
    """The same with numbers of other sizes and signs; lengths stay positive."""
    factors = np.exp(rng.normal(0, 1.5, len(PARAMETERS)))
    signs = np.where(
        [name.endswith(("_m", "_s", "_scale")) for name in PARAMETERS], 1.0, rng.choice([-1, 1], len(PARAMETERS))
    )
    return replace(law, parameters=law.parameters * factors * signs, weights=law.weights * rng.choice([1.0, 100.0]))


def assert_bounded(speeds: np.ndarray, slopes: np.ndarray, times: np.ndarray) -> None:
    """`slopes` hold between the times. No faster than free fall, nor than the wheels without load."""
    changes, spans = np.diff(speeds), np.diff(times)
    falls = GRAVITY * np.abs(np.sin(slopes)) * spans * (1 + 1e-9) + 1e-9
    uphill, downhill = slopes > 0, slopes < 0
    before, after = speeds[:-1], speeds[1:]
    assert (after <= np.maximum(before, RIM_SPEED) + np.where(downhill, falls, 1e-9)).all()
    assert (after >= np.minimum(before, 0.0) - np.where(uphill, falls, 1e-9)).all()
    assert np.isfinite(changes).all()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_nothing_falls_faster_than_freely_nor_climbs_faster_than_its_wheels(law: Law, seed: int):
    rng = np.random.default_rng(seed)
    engine = Engine(law if rng.random() < 0.3 else wild(law, rng))
    slope = np.radians(rng.uniform(-45, 45))
    mass, torque = 10 ** rng.uniform(-3, 6), rng.choice([0.0, 10 ** rng.uniform(-2, 4)])
    start = engine.start(mass, rng.choice([0.0, rng.uniform(-20, 20)]))
    parts = rng.integers(1, 4)
    controls = Controls(np.sort(rng.uniform(0, 10, parts)), np.full(parts, torque), rng.random(parts) < 0.3)
    motion, end = engine.drive(start, Track.constant(slope), controls, TIMES, rng.choice([0.0, 0.05, -0.05]))
    assert_bounded(motion.speed_m_s, np.full(400, slope), TIMES)
    for column in (motion.x_m, motion.front_wheel_rad_s, motion.rear_wheel_rad_s, motion.y_m, end.numbers):
        assert np.isfinite(column).all()


@given(st.integers(0, 2**32 - 1))
def test_steps_under_anything_stay_finite_and_bounded(engine: Engine, seed: int):
    rng = np.random.default_rng(seed)
    count = 20
    masses, starts = 10 ** rng.uniform(-3, 6, count), rng.uniform(-20, 20, count)
    states = states_array([engine.start(*each) for each in zip(masses, starts, strict=True)])
    speeds = starts
    for _ in range(10):
        slopes, durations = np.radians(rng.uniform(-45, 45, count)), 10 ** rng.uniform(-5, 1, count)
        torques, brakes = rng.uniform(0, 1e4, count), rng.random(count) < 0.3
        states, motion = engine.step(states, slopes, torques, brakes, durations)
        assert np.isfinite(states).all()
        for before, after, slope, duration in zip(speeds, motion.speed_m_s, slopes, durations, strict=True):
            assert_bounded(np.array([before, after]), np.array([slope]), np.array([0.0, duration]))
        speeds = motion.speed_m_s


@pytest.mark.parametrize("slope_deg", [-20.0, -5.0, 0.0, 5.0, 12.0])
def test_locked_wheels_stop_a_rover_and_hold_it(engine: Engine, slope_deg: float):
    start = engine.start(430.0, 0.5)
    controls = Controls(np.zeros(1), np.array([60.0]), np.array([True]))
    motion, _ = engine.drive(start, Track.constant(np.radians(slope_deg)), controls, TIMES)
    sizes = np.abs(motion.speed_m_s)
    assert (sizes[1:] <= np.maximum(sizes[:-1], 0.01)).all()  # it creeps where it stands
    assert sizes[-1] < 0.01
    assert (motion.front_wheel_rad_s == 0).all()


def test_free_wheels_do_not_drive(engine: Engine):
    controls = Controls.constant(0.0)
    motion, _ = engine.drive(engine.start(430.0, 0.4), Track.constant(0.0), controls, TIMES)
    assert (np.diff(motion.speed_m_s) <= 1e-9).all()
    rest, _ = engine.drive(engine.start(430.0), Track.constant(0.0), controls, TIMES, offset=-0.05)
    assert (rest.x_m == 0).all()


def test_speed_settles(engine: Engine):
    times = np.array([30.0, 60.0, 120.0])
    for slope_deg, torque in ((5.0, 60.0), (15.0, 90.0), (0.0, 40.0)):
        _, speed, front, rear, _ = engine.constant(
            np.radians([slope_deg]), np.array([430.0]), np.array([torque]), 0.0, times
        )
        assert np.ptp(speed) < 1e-5
        assert np.ptp(front) < 1e-4
        assert np.ptp(rear) < 1e-4
        assert 0 < speed[0, 0] < RIM_SPEED
