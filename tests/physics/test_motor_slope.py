from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.physics.motor_slope import MotorSlope, travel_factor
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios
from tests.physics.strategies import coefficients, masses_kg, scenario, slopes_deg, times


def prior(resistance: float, no_load_speed_rad_s: float = VIPER.no_load_speed_rad_s) -> MotorSlope:
    return MotorSlope(replace(VIPER, no_load_speed_rad_s=no_load_speed_rad_s), LUNAR_REGOLITH, resistance)


def runge_kutta(model: MotorSlope, one: Scenarios, until_s: float, steps: int) -> float:
    """x after `until_s` from rest, by the classical fourth-order method on (x, v)."""
    step, x, v = until_s / steps, np.zeros(1), np.zeros(1)
    rate = model.acceleration_m_s2
    for _ in range(steps):
        a1 = rate(one, v)
        a2 = rate(one, v + step / 2 * a1)
        a3 = rate(one, v + step / 2 * a2)
        a4 = rate(one, v + step * a3)
        x = x + step * v + step**2 / 6 * (a1 + a2 + a3)
        v = v + step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return float(x[0])


@pytest.mark.slow
@given(scenario, coefficients, st.floats(0.1, 5))
def test_solves_its_own_equation(one, resistance, until_s):
    model = prior(resistance)
    rate = float(model.braking_rate_per_s(one)[0])
    steps = 200 + int(20 * rate * until_s)
    exact = float(model.positions(one, np.array([until_s])).x_m[0, 0])
    scale = 1e-3 + abs(float(model.acceleration_at_rest_m_s2(one)[0])) * until_s**2
    assert exact == pytest.approx(runge_kutta(model, one, until_s, steps), abs=1e-7 * scale)


def test_integration_converges_to_it_with_fourth_order():
    model, one = prior(0.1), Scenarios.of(20, 430, 60)
    exact = float(model.positions(one, np.array([3.0])).x_m[0, 0])
    errors = [abs(runge_kutta(model, one, 3.0, steps) - exact) for steps in (40, 80, 160)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.5)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4, abs=0.5)


@given(slopes_deg, masses_kg, coefficients, times)
def test_without_a_motor_the_rover_slides_freely(slope, mass, resistance, time_s):
    one = Scenarios.of(slope, mass, 0)
    sine, cosine = np.sin(np.radians(slope)), np.cos(np.radians(slope))
    expected = -0.5 * LUNAR_REGOLITH.gravity_m_s2 * (sine + resistance * cosine) * time_s**2
    np.testing.assert_allclose(prior(resistance).positions(one, time_s).x_m[0], expected, rtol=1e-12, atol=1e-12)


@given(scenario, coefficients, times)
def test_without_a_speed_limit_the_acceleration_is_constant(one, resistance, time_s):
    model = prior(resistance, np.inf)
    expected = 0.5 * model.acceleration_at_rest_m_s2(one)[0] * time_s**2
    np.testing.assert_allclose(model.positions(one, time_s).x_m[0], expected, rtol=1e-12)


def test_tends_to_the_terminal_speed():
    model, one = prior(0.1), Scenarios.of(10, 430, 60)
    x = model.positions(one, np.array([100.0, 101.0])).x_m[0]
    assert x[1] - x[0] == pytest.approx(float(model.terminal_speed_m_s(one)[0]), rel=1e-9)


def test_terminal_speed_on_level_ground_without_resistance_is_the_no_load_speed():
    model = prior(0.0)
    assert model.terminal_speed_m_s(Scenarios.of(0, 430, 60))[0] == pytest.approx(np.pi * 0.25, rel=1e-12)


@given(scenario, coefficients, times)
def test_doubling_mass_and_torque_leaves_x_unchanged(one, resistance, time_s):
    double = Scenarios(one.slope_angle_rad, 2 * one.mass_kg, 2 * one.torque_nm)
    model = prior(resistance)
    np.testing.assert_allclose(model.positions(double, time_s).x_m, model.positions(one, time_s).x_m, rtol=1e-9)


@given(scenario, times)
def test_rides_higher_when_lighter(one, time_s):
    heavier = Scenarios(one.slope_angle_rad, 1.5 * one.mass_kg, one.torque_nm)
    assert (prior(0).positions(heavier, time_s).y_m < prior(0).positions(one, time_s).y_m).all()


def test_static_sinkage_by_hand():
    # One wheel of 430 kg on level ground carries 430*1.62/4 = 174.15 N; 3*174.15/(0.2*2*827000*sqrt(0.5)) = 2.23353e-3;
    # to the power 2/3: 0.017087 m.
    positions = prior(0).positions(Scenarios.of(0, 430, 60), np.zeros(1))
    assert positions.y_m[0, 0] == pytest.approx(0.25 - 0.017087, abs=2e-6)


@pytest.mark.parametrize("z", [0.0, 1e-12, 1e-6, 1e-3, 0.05, 0.0999999999, 0.1, 0.1000000001, 0.7, 5.0, 500.0])
def test_travel_factor_against_its_power_series(z):
    # z**n / (n+2)! with alternating signs, in exact integer arithmetic, up to z = 5; beyond it the exponential is gone
    from fractions import Fraction

    if z > 5:
        expected = (z - 1) / z**2
    else:
        term, total = Fraction(1, 2), Fraction(0)
        for n in range(60):
            total += term
            term *= -Fraction(z) / (n + 3)
        expected = float(total)
    assert travel_factor(np.array([z]))[0] == pytest.approx(expected, rel=1e-13)
