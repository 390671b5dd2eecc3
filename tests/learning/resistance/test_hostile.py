"""Nothing that the engine is handed makes it read or write out of bounds; `make sanitize` sees what goes unnoticed."""

from __future__ import annotations

import copy
import ctypes
import math
import mmap
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.resistance.engine import Engine, step_times
from service.learning.resistance.features import scaled_features, stall_gate
from service.learning.resistance.fit import FittedProcess
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.library import Model, address, contiguous, first, library, require_success
from service.learning.resistance.start import fit_start, start_features
from service.learning.resistance.traction import TractionCurves, mean_shear
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios

TIMES = np.linspace(0.0, 10.0, 201)
HYPER, CURVES = Hyperparameters(), TractionCurves()
WILD = np.array([math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -1.0, 1e-300, 1e308, -1e308, 2.0**63, -(2.0**64)])


@given(st.lists(st.floats(), min_size=3, max_size=3))
@settings(max_examples=200)
def test_no_scenario_leads_out_of_bounds(fitted: FittedProcess, numbers: list[float]):
    """It must come back, with anything."""
    angle, mass, ratio = (np.array([number]) for number in numbers)
    x, _ = fitted.model._engine.predict(angle, mass, ratio, TIMES)
    assert x.shape == (1, 201)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=60)
def test_no_number_of_a_model_leads_out_of_bounds(fitted: FittedProcess, seed: int):
    """It must come back, with anything: a few or many of the struct's and the tables' numbers are wild."""
    rng = np.random.default_rng(seed)
    model = fitted.model
    engine = Engine(*copy.deepcopy([getattr(model, each.name) for each in fields(model) if each.init]))
    struct, slots = np.frombuffer(engine._model, dtype=np.float64), np.array(list(numbers_of(Model))) // 8
    struct[rng.permutation(slots)[: rng.integers(0, 4)]] = rng.choice(WILD)
    for array in engine._kept:
        if array.dtype == np.float64 and rng.random() < 0.2:
            array.flat[rng.integers(0, array.size, rng.choice([1, 1000]))] = rng.choice(WILD)
    columns = rng.uniform(-1, 1, 4), rng.uniform(100, 2000, 4), rng.uniform(0, 2, 4)
    x, _ = engine.predict(*columns, rng.choice([-1e308, -1.0, 0.0, 5e-324, 0.3, 7.0, 40.0], (4, 30)))
    assert x.shape == (4, 30)


def numbers_of(struct: type[ctypes.Structure], start: int = 0) -> Iterator[int]:
    """Where a struct and those in it have numbers, in bytes."""
    for name, kind in struct._fields_:
        at = start + getattr(struct, name).offset
        one, count = (kind._type_, kind._length_) if issubclass(kind, ctypes.Array) else (kind, 1)
        for each in range(at, at + count * ctypes.sizeof(one), ctypes.sizeof(one)):
            if issubclass(one, ctypes.Structure):
                yield from numbers_of(one, each)
            elif one is ctypes.c_double:
                yield each


def test_numbers_of_a_struct_are_found():
    assert len(list(numbers_of(Model))) * 8 < ctypes.sizeof(Model)
    assert {Model.gravity_m_s2.offset, Model.laws.offset + 8, Model.height.offset + 40} <= set(numbers_of(Model))


def test_times_that_grow_meanwhile_stay_in_bounds(fitted: FittedProcess):
    """As if another thread wrote to them: the second scenario's times are where the first one's travel goes."""
    memory, count = np.zeros(50), 10
    memory[:count] = np.linspace(0.0, 100.0, count)
    scenarios = np.repeat([-1.0, 430.0, 0.3], 2)
    model = ctypes.addressof(fitted.model._engine._model)
    require_success(
        library().rover_predict(model, 2, first(scenarios), count, first(memory), count, first(memory[count:]))
    )
    assert memory[2 * count - 1] > 1000.0
    assert memory[3 * count - 1] == memory[2 * count - 1]  # held where the steps end


@pytest.mark.parametrize("refine", [0, -1, -(2**40)])
def test_steps_that_are_none_are_refused(fitted: FittedProcess, refine: int):
    room = np.full(4, 7.0)
    assert library().rover_step_times(10.0, refine, 0, address(room)) == -1
    assert (room == 7.0).all()
    with pytest.raises(ValueError, match="refine"):
        step_times(10.0, refine)


def test_steps_without_end_are_refused():
    for horizon_s in (math.nan, -1.0, -math.inf):
        with pytest.raises(ValueError, match="horizon"):
            step_times(horizon_s)
    for horizon_s, refine in ((math.inf, 1), (1e300, 1), (10.0, 2**62)):
        with pytest.raises(MemoryError, match="horizon"):
            step_times(horizon_s, refine)


def test_more_times_than_memory_are_refused(fitted: FittedProcess):
    with pytest.raises(MemoryError):
        fitted.model.positions(Scenarios.of(28, 430, 60), np.broadcast_to(1.0, 2**45))


def test_an_unknown_status_is_no_success():
    with pytest.raises(MemoryError):
        require_success(99)


def test_arrays_at_odd_addresses_are_copied(fitted: FittedProcess):
    odd = np.frombuffer(b"." + TIMES.tobytes(), dtype=np.float64, offset=1)
    assert not odd.flags.aligned
    assert contiguous(odd).flags.aligned
    asked = Scenarios.of(28, 430, 60)
    np.testing.assert_array_equal(fitted.model.positions(asked, odd).x_m, fitted.model.positions(asked, TIMES).x_m)
    np.testing.assert_array_equal(mean_shear(odd), mean_shear(TIMES))


def test_what_is_read_is_not_written(fitted: FittedProcess, tmp_path: Path):
    """Writing to a page that may only be read would end the process."""
    path = tmp_path / "numbers"
    path.write_bytes(np.linspace(0.1, 1.0, 30).tobytes())
    with path.open("rb") as file:
        numbers = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    assert contiguous(numbers) is numbers
    pairs, threes = numbers.reshape(15, 2), numbers.reshape(10, 3)
    scenarios = Scenarios(numbers, numbers, numbers)
    assert fitted.model.positions(scenarios, numbers).x_m.shape == (30, 30)
    assert fitted.model.positions(Scenarios(*threes[:3].T), pairs[:6].reshape(3, 4)).x_m.shape == (3, 4)
    assert CURVES.rear(numbers, numbers).shape == mean_shear(numbers).shape == (30,)
    assert scaled_features(scenarios, VIPER, LUNAR_REGOLITH, HYPER).shape == (30, 3)
    assert stall_gate(threes, numbers[:10], HYPER).shape == (10,)
    assert start_features(numbers, numbers).shape == (30, 2)
    assert fit_start(pairs, numbers[:15], numbers[:15])[0].weights.shape == (15, 2)


def test_nothing_is_made_of_nothing(fitted: FittedProcess):
    none = np.array([])
    scenarios = Scenarios(none, none, none)
    assert fitted.model.positions(scenarios, TIMES).x_m.shape == (0, 201)
    assert fitted.model.positions(scenarios, none).x_m.shape == (0, 0)
    assert CURVES.rear(none, 1.0).shape == mean_shear(none).shape == (0,)
    assert scaled_features(scenarios, VIPER, LUNAR_REGOLITH, HYPER).shape == (0, 3)
    assert stall_gate(np.empty((0, 3)), none, HYPER).shape == (0,)
    assert start_features(none, none).shape == (0, 2)


def test_parts_refuse_shapes_that_do_not_fit():
    for features, margins in (((3,), (1,)), ((4, 3), (5,)), ((4, 2), (4,)), ((4, 3), (2, 2))):
        with pytest.raises(ValueError, match="do not fit"):
            stall_gate(np.zeros(features), np.zeros(margins), HYPER)
    for angles, masses in (((3,), (2,)), ((2, 2), (2, 2))):
        with pytest.raises(ValueError, match="do not fit"):
            start_features(np.zeros(angles), np.zeros(masses))
    for shape in ((4,), (4, 1), (4, 3), (4, 2, 2)):
        with pytest.raises(ValueError, match="start features"):
            fit_start(np.zeros(shape), np.zeros(4), np.zeros(4))


def test_gates_have_the_shape_of_their_margins():
    scaled, margins = np.random.default_rng(0).normal(size=(2, 5, 3)), np.full((2, 5), 0.3)
    gates = stall_gate(scaled, margins, HYPER)
    np.testing.assert_array_equal(gates, [stall_gate(*each, HYPER) for each in zip(scaled, margins, strict=True)])
