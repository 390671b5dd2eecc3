"""The same inputs give the same motion, however it is cut into calls and times."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.learning.drive.engine import Engine, Motion
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.state import State
from tests.learning.drive.drives import Drive, controls_after, drives

CLOSE = 1e-9


def columns(motion: Motion) -> np.ndarray:
    return np.array([motion.x_m, motion.speed_m_s, motion.front_wheel_rad_s, motion.rear_wheel_rad_s, motion.y_m])


def in_pieces(engine: Engine, drive: Drive, times: np.ndarray) -> tuple[np.ndarray, State]:
    """Position, speed and height at times, each reached by a call of its own from the state before."""
    state, now, found = engine.start(drive.mass_kg, drive.start_speed_m_s), 0.0, []
    for time in times:
        controls = controls_after(drive.controls, now)
        motion, state = engine.drive(state, drive.track, controls, np.array([time - now]))
        found.append(columns(motion)[:, -1])
        now = time
    return np.array(found).T, state


@given(drives(), st.integers(0, 2**32 - 1))
def test_any_pieces_give_what_one_go_gives(engine: Engine, drive: Drive, seed: int):
    times = np.sort(np.random.default_rng(seed).uniform(0.01, drive.horizon_s, 30))
    start = engine.start(drive.mass_kg, drive.start_speed_m_s)
    whole, end = engine.drive(start, drive.track, drive.controls, times)
    pieces, last = in_pieces(engine, drive, times)
    np.testing.assert_allclose(pieces[:2], columns(whole)[:2], rtol=0, atol=CLOSE)
    np.testing.assert_allclose(pieces[4], whole.y_m, rtol=0, atol=CLOSE)
    np.testing.assert_allclose([last.x_m, last.speed_m_s], [end.x_m, end.speed_m_s], rtol=0, atol=CLOSE)


@given(drives())
def test_pieces_that_end_with_cells_are_the_same_to_the_bit(engine: Engine, drive: Drive):
    brake = np.asarray(drive.controls.brake)
    controls = Controls(np.round(drive.controls.time_s * 2) / 2, drive.controls.torque_nm, brake)
    drive = Drive(drive.mass_kg, drive.start_speed_m_s, drive.track, controls, drive.horizon_s)
    times = np.arange(1, 17) * 0.5
    whole, end = engine.drive(engine.start(drive.mass_kg, drive.start_speed_m_s), drive.track, drive.controls, times)
    pieces, last = in_pieces(engine, drive, times)
    np.testing.assert_array_equal(pieces, columns(whole))
    assert last == end


@given(drives(), st.integers(0, 2**32 - 1))
def test_what_else_is_asked_changes_nothing(engine: Engine, drive: Drive, seed: int):
    more = np.sort(np.random.default_rng(seed).uniform(0.0, drive.horizon_s, 50))
    times = np.sort(np.concatenate([more, [0.0, drive.horizon_s]]))
    start = engine.start(drive.mass_kg, drive.start_speed_m_s)
    dense, end = engine.drive(start, drive.track, drive.controls, times)
    few, same = engine.drive(start, drive.track, drive.controls, np.array([0.0, drive.horizon_s]))
    assert end == same
    np.testing.assert_array_equal(columns(few), columns(dense)[:, [0, -1]])


@given(drives(), st.sampled_from([0.001, 0.007, 0.01, 0.033, 0.1, 0.25]))
def test_steps_along_a_track_are_a_drive(engine: Engine, drive: Drive, dt_s: float):
    count = min(int(drive.horizon_s / dt_s), 200)
    knots = np.round(drive.controls.time_s / dt_s).astype(int)
    controls = Controls(knots * dt_s, drive.controls.torque_nm, drive.controls.brake)
    times = np.arange(1, count + 1) * dt_s
    start = engine.start(drive.mass_kg, drive.start_speed_m_s)
    whole, end = engine.drive(start, drive.track, controls, times)
    states, positions = start.numbers[None], []
    for step in range(count):
        now = np.searchsorted(knots, step, side="right") - 1
        brake = bool(np.asarray(controls.brake)[now])
        states, motion = engine.step(states, 0.0, controls.torque_nm[now], brake, dt_s, drive.track)
        positions.append(motion.x_m[0])
    np.testing.assert_allclose(positions, whole.x_m, rtol=0, atol=CLOSE)
    assert abs(State(states[0]).speed_m_s - end.speed_m_s) < CLOSE


def test_rovers_do_not_know_each_other(engine: Engine):
    rng = np.random.default_rng(0)
    states = np.array([engine.start(mass).numbers for mass in rng.uniform(300, 900, 20)])
    slopes, torques, durations = rng.uniform(-0.4, 0.5, 20), rng.uniform(0, 120, 20), rng.uniform(0.01, 3, 20)
    brakes = rng.random(20) < 0.3
    together, motion = engine.step(states, slopes, torques, brakes, durations)
    for i in range(20):
        alone, one = engine.step([State(states[i])], slopes[i], torques[i], bool(brakes[i]), durations[i])
        np.testing.assert_array_equal(alone[0], together[i])
        assert one.x_m[0] == motion.x_m[i]


def test_constant_is_a_drive_on_one_slope(engine: Engine):
    times = np.linspace(0, 12, 301)
    slopes, masses, torques, speeds = (
        np.radians([-20.0, 5, 20, 31]),
        np.array([430.0, 350, 800, 600]),
        np.array([0.0, 60, 90, 70]),
        np.array([0.1, 0, 0.2, -0.1]),
    )
    found = np.array(engine.constant(slopes, masses, torques, speeds, times))
    for i in range(4):
        start = engine.start(masses[i], speeds[i])
        motion, _ = engine.drive(start, Track.constant(slopes[i]), Controls.constant(torques[i]), times)
        np.testing.assert_array_equal(found[:, i], columns(motion))
    order = np.random.default_rng(0).permutation(len(times))
    mixed = np.array(engine.constant(slopes, masses, torques, speeds, times[order]))
    np.testing.assert_array_equal(mixed, found[:, :, order])
    each = np.array(engine.constant(slopes, masses, torques, speeds, np.tile(times, (4, 1))))
    np.testing.assert_array_equal(each, found)


def test_a_loop_with_a_new_slope_each_step_follows_the_track(engine: Engine):
    """A testbed asks each 10 ms with the slope that it knows: as accurate as a whole drive, and no slower to settle."""
    distance = np.linspace(0, 12, 60)
    track = Track(distance, np.radians(15 + 6 * np.sin(distance)))
    start, half = engine.start(430.0), engine.law.rover.wheelbase_m / 2
    whole, _ = engine.drive(start, track, Controls.constant(60.0), np.array([15.0]))
    for dt_s, within_m in ((0.01, 0.003), (0.05, 0.01)):
        states, x = start.numbers[None], 0.0
        for _ in range(round(15 / dt_s)):
            slope = np.interp(x + half, track.distance_m, track.slope_rad)
            states, motion = engine.step(states, slope, 60.0, False, dt_s)
            x = motion.x_m[0]
        assert abs(x - whole.x_m[0]) < within_m
