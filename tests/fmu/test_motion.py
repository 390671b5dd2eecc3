"""An FMU moves its rover as the engine does, to the bit."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import fmpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fmu.rovers import Rover

STEPS = st.lists(
    st.tuples(
        st.floats(-45.0, 45.0),
        st.floats(0.0, 400.0) | st.sampled_from([0.0, 60.0, 1e4]),
        st.booleans(),
        st.floats(1e-6, 3.0) | st.sampled_from([0.001, 0.02, 0.05, 0.1, 1.0, 60.0]),
    ),
    min_size=1,
    max_size=12,
)


def by_engine(engine, state, slope_deg, torque_nm, brake, step_s):
    """The next state and the motion there."""
    states = state if isinstance(state, np.ndarray) else [state]
    return engine.step(states, math.radians(slope_deg), torque_nm, brake, step_s)


def same(values, motion):
    for name, column in {
        "x_m": motion.x_m,
        "y_m": motion.y_m,
        "speed_m_s": motion.speed_m_s,
        "front_wheel_speed_rad_s": motion.front_wheel_rad_s,
        "rear_wheel_speed_rad_s": motion.rear_wheel_rad_s,
    }.items():
        assert values[name] == column[0], name


@given(steps=STEPS, mass_kg=st.floats(1.0, 1e4), speed=st.floats(-5.0, 5.0))
def test_any_inputs_and_steps_give_the_engines_motion_to_the_bit(made, engine, steps, mass_kg, speed):
    rover = Rover(made).begin(mass_kg=mass_kg, start_speed_m_s=speed, parked=False)
    state, now = engine.start(mass_kg, speed), 0.0
    for slope, torque, brake, step_s in steps:
        rover.set(slope_deg=slope, torque_nm=torque, brake=brake)
        rover.step(now, step_s)
        state, motion = by_engine(engine, state, slope, torque, brake, step_s)
        now += step_s
        values = rover.get()
        same(values, motion)
        assert values["time"] == now
        assert -2.0 <= values["slip_ratio"] <= 2.0
        assert values["moving"] == (abs(values["speed_m_s"]) >= 0.001)
    rover.close()


@pytest.mark.parametrize("slope", [-40.0, -12.0, 0.0, 18.0, 31.0, 45.0])
@pytest.mark.parametrize("mass", [300.0, 430.0, 1000.0])
def test_a_parked_rover_is_let_go_as_the_model_says(made, twin, slope, mass):
    rover = Rover(made).begin(mass_kg=mass, slope_deg=slope, torque_nm=60.0)
    start = twin.model.start(mass, math.radians(slope))
    assert rover.get()["speed_m_s"] == start.speed_m_s
    rover.step(0.0, 10.0)
    _, motion = by_engine(twin.model.engine, start, slope, 60.0, False, 10.0)
    assert rover.get()["x_m"] == motion.x_m[0]
    rover.close()


def test_who_tells_the_slope_after_initialisation_gets_its_release_too(made, twin):
    rover = Rover(made).begin(mass_kg=430.0)
    rover.set(slope_deg=25.0, torque_nm=60.0)
    rover.step(0.0, 1.0)
    _, motion = by_engine(twin.model.engine, twin.model.start(430.0, math.radians(25.0)), 25.0, 60.0, False, 1.0)
    assert rover.get()["x_m"] == motion.x_m[0]
    rover.close()


def test_inputs_act_on_outputs_by_a_step_alone(made):
    rover = Rover(made).begin(slope_deg=10.0)
    for at in range(3):
        before = rover.get()
        rover.set(slope_deg=-20.0 + at, torque_nm=300.0, brake=bool(at % 2))
        after = rover.get()
        assert {n: v for n, v in after.items() if n not in ("slope_deg", "torque_nm", "brake")} == {
            n: v for n, v in before.items() if n not in ("slope_deg", "torque_nm", "brake")
        }
        rover.step(float(at), 1.0)
    rover.close()


def test_slip_ratio_is_that_of_drives(made):
    rover = Rover(made).begin(slope_deg=15.0, torque_nm=80.0)
    rover.step(0.0, 8.0)
    values = rover.get()
    rim = 0.25 * 0.5 * (values["rear_wheel_speed_rad_s"] + values["front_wheel_speed_rad_s"])
    assert values["slip_ratio"] == pytest.approx(1.0 - values["speed_m_s"] / rim, abs=1e-12)
    rover.close()


def test_steps_too_short_to_be_driven_are_driven_together(made, engine):
    rover = Rover(made).begin(mass_kg=430.0, start_speed_m_s=0.3, parked=False, slope_deg=5.0, torque_nm=60.0)
    now = 0.0
    for _ in range(4000):
        rover.step(now, 2.5e-7)
        now += 2.5e-7
    _, motion = by_engine(engine, engine.start(430.0, 0.3), 5.0, 60.0, False, 0.001)
    assert rover.get()["x_m"] == pytest.approx(motion.x_m[0], abs=1e-9)
    assert rover.get()["time"] == now
    rover.close()


def test_pieces_give_what_one_go_gives(made):
    one, many = (Rover(made, name).begin(slope_deg=12.0, torque_nm=70.0) for name in ("one", "many"))
    one.step(0.0, 20.0)
    for at in range(2000):
        many.step(at * 0.01, 0.01)
    assert many.get()["x_m"] == pytest.approx(one.get()["x_m"], abs=1e-9)
    one.close()
    many.close()


def test_the_time_is_that_of_the_simulation(made):
    rover = Rover(made).begin(start_s=100.0)
    assert rover.get()["time"] == 100.0
    rover.step(100.0, 0.5)
    assert rover.get()["time"] == 100.5
    rover.close()


def test_instances_in_threads_do_not_meet(made):
    def drive(number):
        rover = Rover(made, f"rover {number}").begin(mass_kg=300.0 + 10 * number, slope_deg=number - 10.0)
        found = []
        for at in range(100):
            rover.set(torque_nm=50.0 + number, slope_deg=10.0 * math.sin(at * 0.1 * number))
            rover.step(at * 0.1, 0.1)
            found.append(rover.get()["x_m"])
        rover.close()
        return found

    alone = [drive(number) for number in range(24)]
    with ThreadPoolExecutor(8) as threads:
        beside = list(threads.map(drive, range(24)))
    assert beside == alone


def test_fmpy_simulates_it(made, engine):
    """Through FMPy's own loop, with inputs from a table, between whose rows it interpolates."""
    time = np.array([0.0, 5.0, 5.0, 10.0])
    torque = np.array([60.0, 60.0, 0.0, 0.0])
    found = fmpy.simulate_fmu(
        str(made.folder),
        stop_time=10.0,
        output_interval=0.1,
        start_values={"mass_kg": 550.0, "slope_deg": 8.0, "parked": False, "start_speed_m_s": 0.1},
        input=np.rec.fromarrays([time, torque], names=["time", "torque_nm"]),
        output=["x_m", "torque_nm"],
    )
    state = engine.start(550.0, 0.1)
    for before, after in pairwise(found):
        state, motion = by_engine(engine, state, 8.0, after["torque_nm"], False, after["time"] - before["time"])
        assert after["x_m"] == motion.x_m[0]
    assert len(found) == 101
