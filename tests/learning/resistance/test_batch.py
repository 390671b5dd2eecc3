"""Many scenarios at once get what each of them gets alone, whatever else is in the batch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.resistance import model as model_module
from service.learning.resistance import traction
from service.learning.resistance.fit import FittedProcess
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.integrate import TRAVEL_GRID_M
from service.learning.resistance.tables import GRID_CELLS, GRID_KNOTS, TRAVEL_CELLS, TRAVEL_KNOTS_M
from service.learning.resistance.traction import TractionCurves, speed_law, speed_laws
from service.physics.parameters import VIPER
from service.physics.scenario import Positions, Scenarios

TIMES = np.linspace(0.0, 10.0, 201)
# x and y, m: the order of sums differs (1e-14), which the steps of a slow rover may let grow a little
TOLERANCE = {"rtol": 1e-12, "atol": 1e-9}


def drawn(count: int, seed: int) -> Scenarios:
    """Light and heavy, strong and weak, down and up: climbing, stalling and sliding rovers, inside and far outside."""
    rng = np.random.default_rng(seed)
    torque = np.where(rng.random(count) < 0.05, 0.0, rng.uniform(1.0, 250.0, count))
    return Scenarios(np.radians(rng.uniform(-45, 45, count)), 10.0 ** rng.uniform(1.5, 3.5, count), torque)


def taken(scenarios: Scenarios, rows: np.ndarray) -> Scenarios:
    return Scenarios(scenarios.slope_angle_rad[rows], scenarios.mass_kg[rows], scenarios.torque_nm[rows])


def looped(fitted: FittedProcess, scenarios: Scenarios, time_s: np.ndarray) -> Positions:
    times = np.broadcast_to(time_s, (len(scenarios), time_s.shape[-1]))
    alone = [fitted.model.positions(taken(scenarios, np.array([row])), times[row]) for row in range(len(scenarios))]
    return Positions(np.concatenate([each.x_m for each in alone]), np.concatenate([each.y_m for each in alone]))


def assert_same(one: Positions, other: Positions) -> None:
    np.testing.assert_allclose(one.x_m, other.x_m, **TOLERANCE)
    np.testing.assert_allclose(one.y_m, other.y_m, **TOLERANCE)


@given(st.integers(1, 60), st.integers(0, 2**32 - 1), st.sampled_from([0.01, 3.0, 40.0]))
@settings(max_examples=12, deadline=None)
def test_a_batch_is_the_loop(fitted: FittedProcess, count, seed, horizon_s):
    scenarios, times = drawn(count, seed), np.linspace(0.0, horizon_s, 50)
    assert_same(fitted.model.positions(scenarios, times), looped(fitted, scenarios, times))


def test_rovers_that_climb_stall_and_slide_share_a_batch(fitted: FittedProcess):
    slopes, torques = np.tile(np.linspace(10, 45, 60), 2), np.repeat([60.0, 10.0], 60)  # the weaker ones often stall
    ordinary = Scenarios(np.radians(slopes), np.full(120, 430.0), torques)
    scenarios = Scenarios.stack([ordinary, drawn(300, 1)])
    batch = fitted.model.positions(scenarios, TIMES)
    assert_same(batch, looped(fitted, scenarios, TIMES))
    late_m = batch.x_m[:, -1] - batch.x_m[:, 150]
    kinds = (late_m > 0.05, np.abs(late_m) < 0.02, late_m < -0.05, batch.x_m[:, -1] > 1.5)
    assert [kind.sum() > 5 for kind in kinds] == [True] * 4


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=5, deadline=None)
def test_the_order_does_not_matter(fitted: FittedProcess, seed):
    scenarios = drawn(80, seed)
    order = np.random.default_rng(seed).permutation(80)
    there, here = fitted.model.positions(taken(scenarios, order), TIMES), fitted.model.positions(scenarios, TIMES)
    assert_same(there, Positions(here.x_m[order], here.y_m[order]))


@given(st.integers(16, 50), st.integers(0, 2**32 - 1))
@settings(max_examples=6, deadline=None)
def test_each_scenario_may_have_times_of_its_own(fitted: FittedProcess, count, seed):
    scenarios = drawn(count, seed)
    horizons = 10.0 ** np.random.default_rng(seed).uniform(-2, 1.5, count)
    times = np.linspace(0.0, 1.0, 30) * horizons[:, None]
    assert_same(fitted.model.positions(scenarios, times), looped(fitted, scenarios, times))


def test_chunks_do_not_show(fitted: FittedProcess, monkeypatch: pytest.MonkeyPatch):
    scenarios = drawn(100, 3)
    whole = fitted.model.positions(scenarios, TIMES)
    monkeypatch.setattr(model_module, "_MOST_ROWS", 17)
    assert_same(fitted.model.positions(scenarios, TIMES), whole)


def test_a_chunk_of_long_horizons_is_smaller():
    assert model_module._rows_at_once(300) > model_module._rows_at_once(6_000) > model_module._rows_at_once(10**7)
    assert model_module._rows_at_once(10**7) >= 1


def test_nothing_asked_is_nothing_answered(fitted: FittedProcess):
    assert fitted.model.positions(drawn(20, 1), np.array([])).x_m.shape == (20, 0)
    assert (fitted.model.positions(drawn(20, 1), np.array([0.0])).x_m == 0.0).all()


@given(st.integers(1, 150), st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_the_laws_of_many_are_those_of_each(count, seed):
    rng, hyper, curves = np.random.default_rng(seed), Hyperparameters(), TractionCurves()
    columns = np.radians(rng.uniform(-45, 45, count)), rng.uniform(0.0, 2.0, count), rng.uniform(50, 5000, count)
    laws = speed_laws(VIPER, curves, hyper, *columns)
    for row, (angle, ratio, mass) in enumerate(zip(*columns, strict=True)):
        alone, found = speed_law(VIPER, curves, hyper, angle, ratio, mass), laws.one(row)
        np.testing.assert_allclose(found.virgin, alone.virgin, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(found.rut, alone.rut, rtol=1e-12, atol=1e-12)
        assert (found.margin, found.sine) == pytest.approx((alone.margin, alone.sine), abs=1e-12)


@given(st.integers(1, 150), st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_a_law_in_parts_is_the_whole_where_it_is_tabulated(count, seed):
    rng, hyper, curves = np.random.default_rng(seed), Hyperparameters(), TractionCurves()
    ratios = 10.0 ** rng.uniform(-5, 0.3, count)
    columns = np.radians(rng.uniform(-45, 45, count)), ratios, rng.uniform(50, 5000, count)
    parts, whole = (speed_laws(VIPER, curves, hyper, *columns, whole=whole) for whole in (False, True))
    np.testing.assert_array_equal(parts.margin, whole.margin)
    numbers = np.arange(whole.virgin.shape[1])
    there = (parts.first[:, None] <= numbers) & (numbers <= parts.last[:, None])
    assert there[:, 300:480].all()
    for mine, theirs in ((parts.virgin, whole.virgin), (parts.rut, whole.rut)):
        np.testing.assert_allclose(mine[there], theirs[there], rtol=1e-12, atol=1e-12)


def test_scenarios_that_leave_their_laws_are_integrated_again(fitted: FittedProcess, monkeypatch: pytest.MonkeyPatch):
    scenarios = drawn(200, 4)
    whole = fitted.model.positions(scenarios, TIMES)
    again = []
    monkeypatch.setattr(traction, "_MAY_SLIDE_BELOW", -np.inf)
    monkeypatch.setattr(traction, "_MAY_RUN_BELOW", -np.inf)
    integrate = model_module.integrate_many

    def counted(*arguments):
        travel, left = integrate(*arguments)
        again.append(len(left))
        return travel, left

    monkeypatch.setattr(model_module, "integrate_many", counted)
    assert_same(fitted.model.positions(scenarios, TIMES), whole)
    assert again[0] > 20
    assert again[1:] == [0]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_axles_end_to_end_are_read_as_each_alone(seed):
    rng = np.random.default_rng(seed)
    ratios, shares, loads = 10.0 ** rng.uniform(-4, 0.3, 64), rng.uniform(0.02, 0.9, 64), rng.uniform(20, 2000, 64)
    axle = traction._axle_tables(TractionCurves().front, shares, loads, ratios, 0.7854)
    speeds = traction.speed_grid(VIPER)
    alone = [
        np.interp(speeds, speed[1:-1], torque[1:-1]) for speed, torque in zip(axle.speed_m_s, axle.torque, strict=True)
    ]
    # what lies between two nodes of nearly one speed is as steep as it is short
    np.testing.assert_allclose(traction._read(speeds, axle, axle.torque), alone, rtol=0, atol=1e-8)
    assert (~axle.fits).any()
    assert axle.fits.any()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_knots_are_found_without_a_search(seed):
    rng = np.random.default_rng(seed)
    tables, places = rng.normal(size=(70, len(TRAVEL_KNOTS_M))), rng.uniform(-7, 10, (70, 50))
    places[:, :10] = rng.choice(TRAVEL_KNOTS_M, (70, 10))
    expected = [np.interp(place, TRAVEL_KNOTS_M, table) for place, table in zip(places, tables, strict=True)]
    np.testing.assert_allclose(TRAVEL_CELLS.read(places, tables), expected, rtol=0, atol=1e-11)

    grids = [np.interp(TRAVEL_GRID_M, TRAVEL_KNOTS_M, table) for table in tables]
    expected = [np.interp(place, TRAVEL_GRID_M, grid) for place, grid in zip(places, grids, strict=True)]
    np.testing.assert_allclose(GRID_CELLS.read(places, tables[:, GRID_KNOTS]), expected, rtol=0, atol=1e-11)
