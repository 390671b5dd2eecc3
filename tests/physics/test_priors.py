"""Laws that every prior keeps."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given

from service.physics.priors import PRIOR_NAMES, describe_prior, make_prior, restore_prior
from service.physics.scenario import Scenarios
from tests.physics.strategies import coefficients, scenarios, times

every_prior = pytest.mark.parametrize("name", PRIOR_NAMES)


@pytest.mark.slow
@every_prior
@given(scenarios, coefficients)
def test_starts_at_rest_at_the_origin(name, batch, coefficient):
    prior, instant = make_prior(name, coefficient), 1e-6
    x = prior.positions(batch, np.array([0.0, instant])).x_m
    assert (x[:, 0] == 0).all()
    # at rest: no distance to first order in the time
    assert (np.abs(x[:, 1]) <= instant**2 * (1 + np.abs(prior.acceleration_m_s2(batch, np.zeros(len(batch)))))).all()


@pytest.mark.slow
@every_prior
@given(scenarios, times, coefficients)
def test_a_batch_equals_a_loop(name, batch, time_s, coefficient):
    prior = make_prior(name, coefficient)
    together = prior.positions(batch, time_s)
    for row in range(len(batch)):
        one = Scenarios(batch.slope_angle_rad[[row]], batch.mass_kg[[row]], batch.torque_nm[[row]])
        alone = prior.positions(one, time_s)
        np.testing.assert_array_equal(together.x_m[row], alone.x_m[0])
        np.testing.assert_array_equal(together.y_m[row], alone.y_m[0])


@pytest.mark.slow
@every_prior
@given(scenarios, times, coefficients)
def test_times_may_differ_by_scenario(name, batch, time_s, coefficient):
    prior = make_prior(name, coefficient)
    every = np.stack([time_s * (row + 1) for row in range(len(batch))])
    together = prior.positions(batch, every)
    for row in range(len(batch)):
        np.testing.assert_array_equal(together.x_m[row], prior.positions(batch, every[row]).x_m[row])


@pytest.mark.slow
@every_prior
@given(scenarios, times, coefficients)
def test_positions_are_affine_in_the_coefficient(name, batch, time_s, coefficient):
    # what the least-squares calibration relies on
    prior = make_prior(name)
    at = {c: prior.with_coefficient(c).positions(batch, time_s).x_m for c in (0.0, 1.0, coefficient)}
    expected = at[0.0] + coefficient * (at[1.0] - at[0.0])
    np.testing.assert_allclose(at[coefficient], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@every_prior
@given(scenarios, times, coefficients)
def test_answers_are_finite_float64(name, batch, time_s, coefficient):
    positions = make_prior(name, coefficient).positions(batch, time_s)
    for column in (positions.x_m, positions.y_m):
        assert column.dtype == np.float64
        assert column.shape == (len(batch), len(time_s))
        assert np.isfinite(column).all()


@every_prior
def test_survives_json(name):
    prior = make_prior(name, 0.123)
    assert restore_prior(json.loads(json.dumps(describe_prior(prior)))) == prior


def test_an_unknown_prior_is_refused_by_name():
    with pytest.raises(ValueError, match="allowed is one of rigid_slope, motor_slope"):
        make_prior("dune")
