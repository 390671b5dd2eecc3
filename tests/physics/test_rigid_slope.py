from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.rigid_slope import RigidSlope
from service.physics.scenario import Scenarios
from tests.physics.strategies import coefficients, scenario, times

STILL = np.zeros(1)


def prior(friction: float) -> RigidSlope:
    return RigidSlope(VIPER, LUNAR_REGOLITH, friction)


def test_equation_1_by_hand_at_28_deg():
    # Worked out on paper, five digits at a time: sin 28 = 0.469472, cos 28 = 0.882948.
    #   bracket of the weight    (0.6277 + 0.748*0.469472)/1.2836            = 0.762594
    #   weight term              -1.62 * 0.762594 * 0.469472                 = -0.579986
    #   bracket of the friction  (0.6277*0.882948 + 0.748*0.469472)/1.2836   = 0.705354
    #   friction term            0.1 * 1.62 * 0.705354                       = 0.114267
    #   torque term              60 / (0.25 * 430)                           = 0.558140
    acceleration = prior(0.1).acceleration_m_s2(Scenarios.of(28, 430, 60), STILL)
    assert acceleration[0] == pytest.approx(-0.579986 + 0.114267 + 0.558140, abs=2e-6)


def test_equation_1_by_hand_on_level_ground():
    # sin 0 = 0: no weight, friction 0.2 * 1.62 * 0.6277/1.2836 = 0.158441, torque 50/(0.25*400) = 0.5.
    acceleration = prior(0.2).acceleration_m_s2(Scenarios.of(0, 400, 50), STILL)
    assert acceleration[0] == pytest.approx(0.158441 + 0.5, abs=2e-6)


def test_position_by_hand():
    # a = 0.5 (no friction, level): after 10 s 25 m, and y is the wheel radius (equation 2).
    positions = prior(0.0).positions(Scenarios.of(0, 400, 50), np.array([0.0, 2.0, 10.0]))
    assert positions.x_m.tolist() == [[0.0, 1.0, 25.0]]
    assert positions.y_m.tolist() == [[0.25, 0.25, 0.25]]


@given(scenario, times, coefficients)
def test_doubling_mass_and_torque_changes_nothing(one, time_s, friction):
    double = Scenarios(one.slope_angle_rad, 2 * one.mass_kg, 2 * one.torque_nm)
    np.testing.assert_allclose(
        prior(friction).positions(double, time_s).x_m, prior(friction).positions(one, time_s).x_m, rtol=1e-12
    )


@given(scenario, coefficients)
def test_friction_drives_uphill_as_printed(one, friction):
    # The paper's friction is traction: more of it is more acceleration uphill, while the wheel's share is positive.
    share = VIPER.centre_of_mass_ahead_of_rear_axle_m * math.cos(
        one.slope_angle_rad[0]
    ) + VIPER.centre_of_mass_height_m * math.sin(one.slope_angle_rad[0])
    change = prior(friction + 0.1).acceleration_m_s2(one, STILL) - prior(friction).acceleration_m_s2(one, STILL)
    assert change[0] == pytest.approx(0.1 * LUNAR_REGOLITH.gravity_m_s2 * share / VIPER.wheelbase_m, abs=1e-12)
