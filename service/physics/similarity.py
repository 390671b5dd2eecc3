"""Dimensionless groups: scenarios that share them behave alike in the priors."""

from __future__ import annotations

from typing import TypeVar

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios

Numbers = TypeVar("Numbers", float, Array)


def torque_ratio(rover: RoverParameters, regolith: RegolithParameters, scenarios: Scenarios) -> Array:
    """`torque_ratio_of` scenarios, shape (scenario,)."""
    return torque_ratio_of(rover, regolith, scenarios.mass_kg, scenarios.torque_nm)


def torque_ratio_of(
    rover: RoverParameters, regolith: RegolithParameters, mass_kg: Numbers, torque_nm: Numbers
) -> Numbers:
    """tau / (m g R_w), dimensionless: one wheel's stall torque over the weight's at the wheel rim.

    Doubling mass and torque together leaves it, and the paper's equation (1) divided by m, unchanged.
    """
    return torque_nm / (mass_kg * regolith.gravity_m_s2 * rover.wheel_radius_m)
