"""Laws of the traction curves and of the speed law made from them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.traction import (
    TractionCurve,
    TractionCurves,
    axle_shares,
    mean_shear,
    rut_blend,
    speed_law,
)
from service.physics.parameters import VIPER

HYPER, CURVES = Hyperparameters(), TractionCurves()
NEVER_TURNS = replace(HYPER, sticking_margin=-10.0)  # its resistance does not where it slides back
ANGLES = st.floats(-math.radians(45), math.radians(45))
MASSES = st.floats(200, 1200)
RATIOS = st.floats(0.05, 3.0)


@given(st.floats(1e-3, 50))
def test_shear_is_odd_and_saturates(deformation: float):
    here = mean_shear(np.array([deformation, -deformation]))
    assert here[0] == -here[1]
    assert 0 < here[0] < min(1.0, deformation)


@given(st.floats(-1, 3.9), st.floats(0.001, 0.1), st.floats(50, 600))
def test_traction_rises_with_slip(slip: float, more: float, load: float):
    for curve in (CURVES.front, CURVES.rear, CURVES.rear_in_rut):
        low, high = curve(np.array([slip, slip + more]), load)
        assert high >= low


@given(ANGLES, MASSES)
def test_axles_share_the_weight(angle: float, mass: float):
    front, rear = axle_shares(VIPER, HYPER, angle, mass)
    assert front > 0 < rear
    assert front + rear == pytest.approx(math.cos(angle), rel=1e-12)


def test_climbing_shifts_the_weight_to_the_rear_axle():
    level, steep = (axle_shares(VIPER, HYPER, angle, 430.0) for angle in (0.0, 0.4))
    assert level[0] == pytest.approx(VIPER.centre_of_mass_ahead_of_rear_axle_m / VIPER.wheelbase_m - HYPER.share_shift)
    assert steep[0] < level[0]


@given(ANGLES, RATIOS, MASSES)
def test_the_push_falls_with_the_speed(angle: float, ratio: float, mass: float):
    law = speed_law(VIPER, CURVES, HYPER, angle, ratio, mass)
    for table in (law.virgin, law.rut):
        assert np.isfinite(table).all()
        assert (np.diff(table) <= 1e-9).all()


@given(st.floats(0, 0.5), RATIOS, st.floats(0.01, 0.7))
def test_torque_balances_traction_and_the_motor(angle: float, ratio: float, speed: float):
    """With one curve for both axles on equal loads the law solves 2 q (1 - u/u0) = n phi(1 - v/u) for each axle."""
    curve = TractionCurve(0.15, 0.8, 0.3)
    law = speed_law(VIPER, TractionCurves(curve, curve, curve), NEVER_TURNS, angle, ratio, 550.0)
    rim_speed = VIPER.wheel_radius_m * VIPER.no_load_speed_rad_s
    total = 0.0
    for share in axle_shares(VIPER, HYPER, angle, 550.0):
        rims = np.linspace(1e-4, 1.5 * rim_speed, 20001)
        surplus = 2 * ratio * (1 - rims / rim_speed) - share * curve(1 - speed / rims, 275.0)
        total += 2 * ratio * (1 - rims[np.argmax(surplus < 0)] / rim_speed)
    push = float(law.at(np.array([speed]), np.array([0.0]))[0]) + math.sin(angle)
    assert push == pytest.approx(total, abs=2e-3)


@given(st.floats(0.2, 0.7), RATIOS, MASSES)
def test_where_the_rover_slides_back_the_resistance_holds_it(angle: float, ratio: float, mass: float):
    """Twice the resistance, since it is subtracted from what the law gives; nothing of it where the rover climbs."""
    turning = replace(HYPER, sticking_margin=10.0, sticking_wheel_m_s=0.0)
    with_it, without = (speed_law(VIPER, CURVES, each, angle, ratio, mass) for each in (turning, NEVER_TURNS))
    resistance = HYPER.mean_resistance * (mass / HYPER.reference_mass_kg) ** HYPER.mass_exponent
    for speed, share in ((-0.4, 2.0), (0.0, 1.0), (0.4, 0.0)):
        here = np.array([speed]), np.array([0.0])
        more = float(with_it.at(*here)[0] - without.at(*here)[0])
        assert more == pytest.approx(share * resistance * math.cos(angle), abs=1e-3)


@given(st.floats(0.1, 1.0), st.floats(0.1, 2.0), st.floats(50, 600))
def test_wheels_lose_torque_where_the_rover_slides_back(loss: float, over: float, load: float):
    whole, losing = CURVES.rear, replace(CURVES.rear, backing_loss=loss, backing_slip=over)
    climbing, backing = np.linspace(-1, 1, 21), 1.0 + over + np.linspace(0, 1, 5)
    np.testing.assert_array_equal(losing(climbing, load), whole(climbing, load))
    np.testing.assert_allclose(losing(backing, load), (1 - loss) * whole(backing, load))


def test_numbers_that_an_older_description_lacks_leave_everything_as_it_was():
    description = HYPER.describe()
    for name in ("backing_loss", "backing_slip", "share_shift"):
        del description[name]
    older = Hyperparameters.restore(description)
    assert older.backing_loss == older.share_shift == 0.0
    curves = CURVES.describe()
    for curve in curves.values():
        del curve["backing_loss"], curve["backing_slip"]
    assert TractionCurves.restore(curves) == CURVES == CURVES.backing(older)


def test_the_ruts_take_over_smoothly():
    blend = rut_blend(HYPER, np.linspace(-1, 3, 401))
    assert blend[0] == 0.0
    assert blend[-1] == 1.0
    assert (np.diff(blend) >= 0).all()


@pytest.mark.parametrize("change", [{"backing_loss": -0.1}, {"backing_loss": 1.1}, {"backing_slip": 0.0}])
def test_impossible_losses_are_refused(change: dict[str, float]):
    with pytest.raises(ValueError, match="backing"):
        replace(CURVES.rear, **change)


@pytest.mark.parametrize("slip_scale", [0.0, -1.0, math.nan])
def test_impossible_curves_are_refused(slip_scale: float):
    with pytest.raises(ValueError, match="slip_scale"):
        TractionCurve(0.1, 0.5, slip_scale)
