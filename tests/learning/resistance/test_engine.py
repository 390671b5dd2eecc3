"""The compiled engine says what the plain Python of `reference` says, whatever it is asked."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import model_store
from model_store import ModelStore
from service.learning.checkpoint import restore_model
from service.learning.resistance.engine import Engine, step_times
from service.learning.resistance.features import scaled_features, stall_gate
from service.learning.resistance.fit import FittedProcess
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.model import ResistanceProcess
from service.learning.resistance.start import _shape
from service.learning.resistance.tables import ResponseTables
from service.learning.resistance.traction import TractionCurves, axle_shares, mean_shear, speed_law
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Positions, Scenarios
from tests.learning.resistance import reference

TIMES = np.linspace(0.0, 10.0, 201)
# m, beside a rounding error of the distance: a rover that free fall takes far away has a larger one
AGREES = {"rtol": 1e-12, "atol": 1e-9}
HYPER, CURVES = Hyperparameters(), TractionCurves()

INSIDE = st.tuples(st.floats(5, 32), st.floats(350, 900), st.floats(30, 130))
OUTSIDE = st.tuples(
    st.floats(-60, 60),
    st.floats(-1, 6).map(lambda exponent: 10**exponent),
    st.one_of(st.just(0.0), st.floats(-4, 6).map(lambda exponent: 10**exponent)),
)
HORIZONS = st.floats(-4, math.log10(600)).map(lambda exponent: 10**exponent)


@pytest.fixture(scope="module", params=[2, 3])
def shipped(request: pytest.FixtureRequest) -> ResistanceProcess:
    store = ModelStore.open(str(Path(model_store.__file__).parent))
    manifest = store.manifest("viper-lunar", request.param)
    model = restore_model(manifest.checkpoint, store.read_file(manifest, "weights.safetensors"))
    assert isinstance(model, ResistanceProcess)
    return model


def assert_agree(one: Positions, other: Positions) -> None:
    np.testing.assert_allclose(one.x_m, other.x_m, **AGREES)
    np.testing.assert_allclose(one.y_m, other.y_m, **AGREES)


@pytest.mark.slow
@given(st.one_of(INSIDE, OUTSIDE), HORIZONS, st.integers(1, 400), st.integers(0, 2**32 - 1))
@settings(max_examples=80, deadline=None)
def test_any_scenario_at_any_rising_times(shipped: ResistanceProcess, scenario, horizon_s, count, seed):
    times = np.sort(np.random.default_rng(seed).uniform(0.0, horizon_s, count))
    asked = Scenarios.of(*scenario)
    assert_agree(shipped.positions(asked, times), reference.positions(shipped, asked, times))


@pytest.mark.slow
@pytest.mark.parametrize("horizon_s", [1e-4, 10.0, 600.0])
@pytest.mark.parametrize("count", [1, 2, 20_001, 100_000])
def test_few_and_many_times(shipped: ResistanceProcess, horizon_s: float, count: int):
    times, asked = np.linspace(0.0, horizon_s, count), Scenarios.of(28, 430, 60)
    assert_agree(shipped.positions(asked, times), reference.positions(shipped, asked, times))


@given(st.integers(1, 30), st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_times_in_any_order(fitted: FittedProcess, count, seed):
    rng, asked = np.random.default_rng(seed), Scenarios.of(25, 500, 80)
    times = rng.choice(np.concatenate([rng.uniform(0.0, 20.0, 50), step_times(20.0)]), count)
    order = np.argsort(times)
    there, here = fitted.model.positions(asked, times), fitted.model.positions(asked, times[order])
    np.testing.assert_array_equal(there.x_m[:, order], here.x_m)
    np.testing.assert_array_equal(there.y_m[:, order], here.y_m)


@given(st.floats(1e-4, 600), st.sampled_from([1, 3, 16]))
@settings(deadline=None)
def test_steps_reach_the_horizon(horizon_s: float, refine: int):
    found = step_times(horizon_s, refine)
    np.testing.assert_allclose(found, reference.step_times(horizon_s, refine), rtol=0, atol=1e-12)
    assert (np.diff(found) > 0).all()
    assert found[-1] >= horizon_s - 1e-9


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_times_that_are_no_times_are_refused(fitted: FittedProcess, bad: float):
    with pytest.raises(ValueError, match="finite"):
        fitted.model.positions(Scenarios.of(28, 430, 60), np.array([0.0, bad, 1.0]))
    with pytest.raises(ValueError, match="finite"):
        fitted.model.positions(Scenarios.stack([Scenarios.of(28, 430, 60)] * 2), np.array([[0.0, 1.0], [0.0, bad]]))


def test_a_horizon_of_ages_is_refused(fitted: FittedProcess):
    with pytest.raises(MemoryError, match="horizon"):
        fitted.model.positions(Scenarios.of(28, 430, 60), np.array([0.0, 1e300]))


def test_a_time_before_release_is_the_release(fitted: FittedProcess):
    answer = fitted.model.positions(Scenarios.of(28, 430, 60), np.array([-1.0, 0.0, 1.0]))
    assert answer.x_m[0, 0] == answer.x_m[0, 1] == 0.0
    assert answer.y_m[0, 0] == answer.y_m[0, 1]


def test_times_that_fit_no_scenarios_are_refused(fitted: FittedProcess):
    two = Scenarios.stack([Scenarios.of(28, 430, 60)] * 2)
    for shape in ((3, 4), (1, 4), (2, 2, 4)):
        with pytest.raises(ValueError, match="shapes"):
            fitted.model.positions(two, np.zeros(shape))


def test_columns_that_fit_not_each_other_are_refused(fitted: FittedProcess):
    engine = fitted.model._engine
    with pytest.raises(ValueError, match="shapes"):
        engine.predict(np.zeros(2), np.ones(1), np.ones(3), TIMES)
    with pytest.raises(ValueError, match="shapes"):
        engine.predict(np.zeros(2), np.ones(2), np.ones(3), TIMES)


def test_arrays_may_be_of_any_layout(fitted: FittedProcess):
    asked = Scenarios.stack([Scenarios.of(slope, 430, 60) for slope in (20, 24, 28)])
    plain = fitted.model.positions(asked, np.tile(TIMES, (3, 1)))
    backwards = Scenarios(asked.slope_angle_rad[::-1], asked.mass_kg, asked.torque_nm)
    fixed = np.asfortranarray(np.tile(TIMES, (3, 1)))
    fixed.flags.writeable = False
    np.testing.assert_array_equal(fitted.model.positions(asked, fixed).x_m, plain.x_m)
    np.testing.assert_array_equal(fitted.model.positions(backwards, TIMES.astype(np.float32)).x_m.shape, (3, 201))
    np.testing.assert_array_equal(fitted.model.positions(backwards, TIMES).x_m, plain.x_m[::-1])


@pytest.mark.slow
def test_threads_do_not_meet(shipped: ResistanceProcess):
    scenarios = [Scenarios.of(slope, 430, 60) for slope in np.linspace(5, 35, 200)]
    alone = [shipped.positions(each, TIMES).x_m for each in scenarios]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda each: shipped.positions(each, TIMES).x_m, scenarios * 5))
    for number, answer in enumerate(together):
        np.testing.assert_array_equal(answer, alone[number % 200])


@pytest.mark.parametrize("bits", [128, 256])
def test_vectors_of_any_width_give_the_same_bits(shipped: ResistanceProcess, bits: int):
    """Compared with the widest of this machine: all add and multiply in the same order."""
    plain = replace(shipped)
    plain._engine._model.laws.vector_bits = bits
    rng = np.random.default_rng(0)
    columns = np.radians(rng.uniform(-40, 40, 200)), rng.uniform(100, 2000, 200), rng.uniform(0, 150, 200)
    one, other = (model.positions(Scenarios(*columns), TIMES) for model in (shipped, plain))
    np.testing.assert_array_equal(one.x_m, other.x_m)
    np.testing.assert_array_equal(one.y_m, other.y_m)


@pytest.mark.slow
@given(st.floats(-math.radians(60), math.radians(60)), st.floats(-5, 1), st.floats(20, 5000))
@settings(max_examples=60, deadline=None)
def test_laws_are_the_plain_ones(angle: float, exponent: float, mass: float):
    found = speed_law(VIPER, CURVES, HYPER, angle, 10**exponent, mass)
    plain = reference.speed_law(VIPER, CURVES, HYPER, angle, 10**exponent, mass)
    # what lies between two nodes of nearly one speed is as steep as it is short
    np.testing.assert_allclose(found.virgin, plain.virgin, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.rut, plain.rut, rtol=0, atol=1e-8)
    assert found.margin == pytest.approx(plain.margin, abs=1e-9)
    assert found.sine == plain.sine
    assert axle_shares(VIPER, HYPER, angle, mass) == pytest.approx(reference.axle_shares(VIPER, HYPER, angle, mass))


@given(st.integers(1, 20), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_parts_are_the_plain_ones(count: int, seed: int):
    rng = np.random.default_rng(seed)
    some = Scenarios(rng.uniform(-1, 1, count), 10 ** rng.uniform(0, 5, count), rng.uniform(0, 500, count))
    scaled = reference.scaled_features(some, VIPER, LUNAR_REGOLITH, HYPER)
    np.testing.assert_allclose(scaled_features(some, VIPER, LUNAR_REGOLITH, HYPER), scaled, rtol=1e-12, atol=1e-12)
    margins = rng.uniform(-20, 20, count)
    gates = reference.stall_gate(scaled, margins, HYPER)
    np.testing.assert_allclose(stall_gate(scaled, margins, HYPER), gates, rtol=1e-11, atol=1e-300)
    one, two = rng.normal(size=(count, 2)), rng.normal(size=(7, 2))
    np.testing.assert_allclose(_shape(one, two), reference.start_shape(one, two), rtol=1e-12, atol=1e-12)
    slips, loads = rng.uniform(-2, 5, (count, 3)), 10 ** rng.uniform(0, 4)
    for curve in (CURVES.front, CURVES.rear, CURVES.rear_in_rut):
        np.testing.assert_allclose(curve(slips, loads), reference.traction(curve, slips, loads), rtol=1e-12)
    sizes = 10 ** rng.uniform(-9, 3, count) * rng.choice([-1.0, 0.0, 1.0], count)
    np.testing.assert_allclose(mean_shear(sizes), reference.mean_shear(sizes), rtol=1e-9, atol=1e-16)


def test_tables_that_do_not_fit_are_refused(fitted: FittedProcess):
    model = fitted.model
    short = ResponseTables(
        **{name: getattr(model.height, name)[:-1] for name in ("level", "rut", "travel", "release", "stall")}
    )
    with pytest.raises(ValueError, match="do not fit"):
        replace(model, height=short)


def test_a_model_lives_as_long_as_it_is_needed(fitted: FittedProcess):
    engine = Engine(*(np.copy(each) if isinstance(each, np.ndarray) else each for each in _parts(fitted.model)))
    ratio = np.array([0.3])
    before, _ = engine.predict(np.array([0.4]), np.array([430.0]), ratio, TIMES)
    rubbish = [np.full(size, np.nan) for size in (801, 80 * 464, 256, 1301, 26 * 16) for _ in range(50)]
    after, _ = engine.predict(np.array([0.4]), np.array([430.0]), ratio, TIMES)
    np.testing.assert_array_equal(before, after)
    assert rubbish


def _parts(model: ResistanceProcess) -> tuple[object, ...]:
    return (
        model.prior,
        model.hyper,
        model.curves,
        model.features,
        model.time_knots_s,
        model.resistance,
        model.height,
        model.start,
    )
