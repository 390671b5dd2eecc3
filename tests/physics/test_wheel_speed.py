from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios
from service.physics.wheel_speed import motion_resistance_at, slip_ratio, wheel_speed_rad_s
from tests.physics.strategies import coefficients, scenario


def test_by_hand_at_28_deg():
    # Load 430*1.62*0.469472 = 327.03 N on four wheels of 0.25 m: 20.440 N m of 60 each, so (1 - 0.34066) pi.
    speed = wheel_speed_rad_s(VIPER, LUNAR_REGOLITH, 0.0, Scenarios.of(28, 430, 60))
    assert speed[0] == pytest.approx(2.07138, abs=2e-5)


@given(st.floats(0, 40), st.floats(100, 900), st.floats(20, 200), st.floats(0.01, 3.14))
def test_resistance_is_the_inverse_of_speed(slope, mass, torque, speed):
    one = Scenarios.of(slope, mass, torque)
    resistance = motion_resistance_at(VIPER, LUNAR_REGOLITH, one, speed)
    assert wheel_speed_rad_s(VIPER, LUNAR_REGOLITH, resistance, one)[0] == pytest.approx(speed, abs=1e-9)


@given(scenario, coefficients)
def test_stays_between_standstill_and_no_load_speed(one, resistance):
    assert 0 <= wheel_speed_rad_s(VIPER, LUNAR_REGOLITH, resistance, one)[0] <= VIPER.no_load_speed_rad_s


def test_without_torque_the_wheels_stand_still():
    assert wheel_speed_rad_s(VIPER, LUNAR_REGOLITH, 0.1, Scenarios.of(0, 430, 0))[0] == 0


@pytest.mark.parametrize(("speed", "expected"), [(0.5, 0.0), (0.25, 0.5), (0.0, 1.0), (-0.5, 2.0)])
def test_slip_ratio_of_rolling_slipping_spinning_and_sliding_back(speed, expected):
    assert slip_ratio(VIPER, speed, 2.0) == pytest.approx(expected)


def test_slip_ratio_of_standing_wheels_is_unknown():
    assert slip_ratio(VIPER, 0.1, 0.0) is None
