"""Nothing that the engine is handed makes it read or write out of bounds; `make sanitize` sees what goes unnoticed."""

from __future__ import annotations

import math
from ctypes import addressof

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.drive.engine import Engine
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.library import MOST_S, OUTPUTS, address, library
from service.learning.drive.state import SIZE, State

WILD = np.array([math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -1.0, 1e-300, 1e308, -1e308, 2.0**63, -(2.0**64)])


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=200)
def test_no_number_leads_out_of_bounds(engine: Engine, seed: int):
    """It must come back, with anything: state, law, track, controls, times."""
    rng = np.random.default_rng(seed)

    def spoilt(array: np.ndarray) -> np.ndarray:
        array = np.array(array, dtype=np.float64)
        if rng.random() < 0.5:
            array.flat[rng.integers(0, array.size, rng.integers(1, 4))] = rng.choice(WILD)
        return array

    state = spoilt(engine.drive(engine.start(430.0), TRACK, Controls.constant(60.0), np.array([2.51]))[1].numbers)
    struct = type(engine._laid_out.struct).from_buffer_copy(engine._laid_out.struct)
    numbers, weights = spoilt(engine.law.parameters), spoilt(engine.law.padded_weights(engine.law.weights))
    struct.parameters, struct.weights = address(numbers), address(weights)
    for name in ("gravity_m_s2", "wheel_radius_m", "rim_speed_m_s", "wheelbase_m"):
        if rng.random() < 0.1:
            setattr(struct, name, rng.choice(WILD))
    distance, slope = spoilt(TRACK.distance_m), spoilt(TRACK.slope_rad)
    track, told = (type(kept).from_buffer_copy(kept) for kept in (TRACK.compiled(), CONTROLS.compiled()))
    track.distance_m, track.slope_rad = address(distance), address(slope)
    columns = [spoilt(each) for each in (CONTROLS.time_s, CONTROLS.torque_nm, np.asarray(CONTROLS.brake))]
    told.time_s, told.torque_nm, told.brake = map(address, columns)
    times = np.linspace(0, 3, 50)
    times[rng.integers(0, 50, 3)] = rng.choice([math.nan, -1.0, 1.0, 5.0])
    outputs, offset = np.empty((OUTPUTS, 50)), float(rng.choice([0.0, 0.0, *WILD]))
    library().rover_drive(
        addressof(struct),
        address(state),
        addressof(track),
        addressof(told),
        offset,
        50,
        address(times),
        address(outputs),
    )
    inputs = np.array([[0.1], [60.0], [0.0], [0.3]])
    inputs[rng.integers(0, 3)] = rng.choice(WILD)
    library().rover_step(addressof(struct), 1, address(state), address(inputs), None, address(outputs))


TRACK = Track(np.array([0.0, 1.0, 2.5]), np.array([0.1, 0.3, -0.2]))
CONTROLS = Controls(np.array([0.0, 1.0, 2.0]), np.array([60.0, 0.0, 90.0]), np.array([False, True, False]))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Track(np.array([]), np.array([])), "as many slopes"),
        (lambda: Track(np.array([0.0, 1.0]), np.array([0.1])), "as many slopes"),
        (lambda: Track(np.array([0.0, 0.0]), np.array([0.1, 0.1])), "must rise"),
        (lambda: Track(np.array([1.0, 0.0]), np.array([0.1, 0.1])), "must rise"),
        (lambda: Track(np.array([0.0, math.nan]), np.array([0.1, 0.1])), "finite"),
        (lambda: Track.constant(math.inf), "finite"),
        (lambda: Track.constant(1.6), "less than vertical"),
        (lambda: Controls(np.array([]), np.array([])), "as many torques"),
        (lambda: Controls(np.array([0.0]), np.array([60.0, 60.0])), "as many torques"),
        (lambda: Controls(np.array([1.0, 0.0]), np.array([60.0, 60.0])), "must not fall"),
        (lambda: Controls.constant(-1.0), "not be negative"),
        (lambda: Controls.constant(math.nan), "finite"),
    ],
)
def test_inputs_that_cannot_be_are_refused(call, message: str):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("mass_kg", [0.0, -1.0, math.nan, math.inf])
def test_masses_that_cannot_be_are_refused(engine: Engine, mass_kg: float):
    with pytest.raises(ValueError, match="mass_kg must be positive"):
        engine.start(mass_kg)


@pytest.mark.parametrize("times", [[-0.1], [1.0, 0.5], [math.nan], [math.inf], [0.0, MOST_S * 2]])
def test_times_that_cannot_be_are_refused(engine: Engine, times: list[float]):
    with pytest.raises(ValueError, match="times must"):
        engine.drive(engine.start(430.0), TRACK, CONTROLS, np.array(times))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"slope_rad": math.nan}, "vertical"),
        ({"slope_rad": 2.0}, "vertical"),
        ({"torque_nm": -1.0}, "torques"),
        ({"torque_nm": math.inf}, "torques"),
        ({"dt_s": 0.0}, "dt_s must be"),
        ({"dt_s": 1e9}, "dt_s must be"),
        ({"dt_s": math.nan}, "finite"),
        ({"states": np.zeros((1, SIZE - 1))}, "states must be"),
        ({"states": np.zeros((1, SIZE))}, "another law"),
    ],
)
def test_steps_that_cannot_be_are_refused(engine: Engine, change: dict, message: str):
    asked = {"states": [engine.start(430.0)], "slope_rad": 0.1, "torque_nm": 60.0, "brake": False, "dt_s": 0.1}
    with pytest.raises(ValueError, match=message):
        engine.step(**(asked | change))


def test_nothing_is_made_of_nothing(engine: Engine):
    none = np.array([])
    assert engine.constant(none, none, none, 0.0, np.linspace(0, 1, 5))[0].shape == (0, 5)
    assert engine.constant(np.array([0.1]), np.array([430.0]), np.array([60.0]), 0.0, none)[0].shape == (1, 0)
    assert engine.step([], 0.1, 60.0, False, 0.1)[0].shape == (0, SIZE)
    start = engine.start(430.0)
    motion, end = engine.drive(start, TRACK, CONTROLS, none)
    assert motion.x_m.shape == (0,)
    assert end.x_m == 0.0
    assert isinstance(end, State)
