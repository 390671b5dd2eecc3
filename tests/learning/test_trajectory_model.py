"""The speed of a model of which only positions are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.learning.trajectory_model import motion_by_difference
from service.physics.priors import make_prior
from service.physics.scenario import Positions, Scenarios

TWO = Scenarios(np.radians([5.0, 25.0]), np.array([430.0, 700.0]), np.array([60.0, 90.0]))


@given(st.floats(-2, 2), st.lists(st.floats(0, 100), min_size=1, max_size=20))
def test_an_even_acceleration_from_rest_is_met_from_the_first_moment(pull, times):
    time_s = np.array(times)

    def positions(scenarios: Scenarios, time_s: np.ndarray) -> Positions:
        x = np.broadcast_to(0.5 * pull * time_s**2, (len(scenarios), time_s.shape[-1]))
        return Positions(x, x + 1.0)

    found = motion_by_difference(positions, TWO, time_s)

    np.testing.assert_allclose(found.speed_m_s, np.broadcast_to(pull * time_s, (2, len(time_s))), atol=1e-9)
    np.testing.assert_array_equal(found.x_m, positions(TWO, time_s).x_m)
    np.testing.assert_array_equal(found.y_m, found.x_m + 1.0)
    assert found.rear_wheel_speed_rad_s is found.front_wheel_speed_rad_s is None


@pytest.mark.parametrize("rows", [1, 2])
def test_the_speed_of_a_prior_obeys_its_equation_of_motion(rows):
    prior = make_prior("motor_slope", 0.3)
    time_s = np.linspace(0, 8, 4001)
    asked = time_s if rows == 1 else np.tile(time_s, (rows, 1))
    speed = motion_by_difference(prior.positions, TWO, asked).speed_m_s

    pull = np.array([prior.acceleration_m_s2(TWO, column) for column in speed.T]).T
    np.testing.assert_allclose(np.gradient(speed, time_s, axis=1)[:, 5:-5], pull[:, 5:-5], atol=1e-4)
