"""Dimensionless groups: scenarios that share them behave alike in the priors."""

from __future__ import annotations

import numpy as np

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios


def torque_ratio(rover: RoverParameters, regolith: RegolithParameters, scenarios: Scenarios) -> Array:
    """tau / (m g R_w), dimensionless, shape (scenario,): one wheel's stall torque over the weight's at the wheel rim.

    Doubling mass and torque together leaves it, and the paper's equation (1) divided by m, unchanged.
    """
    weight = scenarios.mass_kg * regolith.gravity_m_s2 * rover.wheel_radius_m
    return np.asarray(scenarios.torque_nm / weight, dtype=np.float64)
