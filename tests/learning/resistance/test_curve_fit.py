"""Curves that made the wheels' speeds are found again in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from service.learning.observed import ObservedRun
from service.learning.resistance.curve_fit import fit_curves
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.traction import TractionCurve, TractionCurves, axle_shares
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios
from service.physics.similarity import torque_ratio

HYPER = Hyperparameters()
TRUTH = TractionCurves(
    TractionCurve(0.14, 0.5, 0.35, 0.5, 0.9), TractionCurve(0.17, 0.8, 0.3, 0.4), TractionCurve(0.12, 0.8, 0.03)
)


def _rim_speed(curve: TractionCurve, share: float, load_kg: float, ratio: float, speed: float) -> float:
    top = VIPER.wheel_radius_m * VIPER.no_load_speed_rad_s
    rims = np.linspace(speed * 0.7, top, 5001)
    surplus = 2 * ratio * (1 - rims / top) - share * curve(1 - speed / rims, load_kg)
    return float(np.interp(0.0, -surplus, rims))


def _run(slope: float, mass: float, torque: float, speed: float) -> ObservedRun:
    """A steady climb whose wheels turn as the true curves demand."""
    scenario = Scenarios.of(slope, mass, torque)
    ratio = float(torque_ratio(VIPER, LUNAR_REGOLITH, scenario)[0])
    front, rear = axle_shares(VIPER, HYPER, float(np.radians(slope)), mass)
    time = np.linspace(0.0, 4.0 / speed, 2001)
    x = speed * time
    rims = [
        _rim_speed(curve, share, load, ratio, speed)
        for curve, share, load in (
            (TRUTH.front, front, 0.5 * mass),
            (TRUTH.rear, rear, rear * mass),
            (TRUTH.rear_in_rut, rear, rear * mass),
        )
    ]
    wheels = [rim / VIPER.wheel_radius_m for rim in rims]
    return ObservedRun(
        f"{slope}/{mass}/{torque}/{speed}",
        "unit",
        scenario,
        time,
        x,
        np.full_like(x, 0.24),
        rear_wheel_speed_rad_s=np.where(x < 1.45, wheels[1], wheels[2]),
        front_wheel_speed_rad_s=np.full_like(x, wheels[0]),
    )


@pytest.fixture(scope="module")
def runs() -> list[ObservedRun]:
    return [
        _run(slope, mass, torque * mass / 430, speed)
        for slope in (2.0, 12.0, 24.0)
        for mass in (350.0, 600.0, 850.0)
        for torque in (60.0, 110.0)
        for speed in (0.25, 0.45)
    ]


def test_the_true_curves_come_back(runs: list[ObservedRun]):
    fitted = fit_curves(runs, VIPER, LUNAR_REGOLITH, HYPER)
    slip = np.linspace(0.1, 0.5, 9)
    for load in (200.0, 400.0):
        np.testing.assert_allclose(fitted.rear(slip, load), TRUTH.rear(slip, load), rtol=0.02)
        np.testing.assert_allclose(fitted.front(slip, load), TRUTH.front(slip, load), rtol=0.03)
    small = np.linspace(0.02, 0.06, 5)
    np.testing.assert_allclose(fitted.rear_in_rut(small, 300.0), TRUTH.rear_in_rut(small, 300.0), rtol=0.03)


def test_without_wheel_speeds_the_stored_curves_stand_in(runs: list[ObservedRun]):
    blind = [replace(run, rear_wheel_speed_rad_s=None) for run in runs]
    assert fit_curves(blind, VIPER, LUNAR_REGOLITH, HYPER) == TractionCurves().backing(HYPER)


def test_one_mass_leaves_the_load_exponents_alone(runs: list[ObservedRun]):
    fitted = fit_curves([run for run in runs if run.mass_kg == 600], VIPER, LUNAR_REGOLITH, HYPER)
    assert fitted.front.load_exponent == pytest.approx(0.9, abs=0.1)
    assert fitted.rear.load_exponent == pytest.approx(0.45, abs=0.1)
