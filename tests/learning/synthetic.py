"""Synthetic runs for unit tests: a known motion that is no prior's, so that there is something to learn."""

from __future__ import annotations

import numpy as np

from service.learning.observed import ObservedRun
from service.physics.priors import make_prior
from service.physics.scenario import Scenarios

HORIZON_S = 4.0


def synthetic_run(slope_deg: float, mass_kg: float = 430.0, torque_nm: float = 60.0, samples: int = 81) -> ObservedRun:
    """Climbs slower than the motor prior and wiggles; wheel height dips and recovers."""
    scenario, time = Scenarios.of(slope_deg, mass_kg, torque_nm), np.linspace(0, HORIZON_S, samples)
    x = make_prior("motor_slope", 0.3).positions(scenario, time).x_m[0]
    slowed = x * (0.6 - 0.01 * slope_deg) - 0.02 * time * np.exp(-time)
    height = 0.235 - 0.0002 * slope_deg - 0.005 * time * np.exp(-2 * time)
    name = f"s{slope_deg:g}_m{mass_kg:g}_t{torque_nm:g}"
    return ObservedRun(name, "unit", scenario, time, slowed, height, mean_wheel_speed_rad_s=2.0)


def synthetic_runs() -> list[ObservedRun]:
    """A dozen of them over slope, mass and torque."""
    runs = [synthetic_run(slope) for slope in (0, 5, 10, 15, 20)]
    runs += [synthetic_run(12, mass) for mass in (300, 600, 900)]
    return runs + [synthetic_run(12, 430, torque) for torque in (30, 45, 90, 120)]
