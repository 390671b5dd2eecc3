"""Many scenarios at once get what each of them gets alone, whatever else is in the batch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.resistance.fit import FittedProcess
from service.physics.scenario import Positions, Scenarios

TIMES = np.linspace(0.0, 10.0, 201)


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
    np.testing.assert_array_equal(one.x_m, other.x_m)
    np.testing.assert_array_equal(one.y_m, other.y_m)


@pytest.mark.slow
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


def test_nothing_asked_is_nothing_answered(fitted: FittedProcess):
    assert fitted.model.positions(drawn(20, 1), np.array([])).x_m.shape == (20, 0)
    assert (fitted.model.positions(drawn(20, 1), np.array([0.0])).x_m == 0.0).all()
