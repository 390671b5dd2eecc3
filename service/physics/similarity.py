"""Dimensionless groups: scenarios that share them behave alike in the priors."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

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


def motors_outweigh_slope(
    rover: RoverParameters, regolith: RegolithParameters, slope_rad: Array, mass_kg: Array, torque_nm: Array
) -> npt.NDArray[np.bool_]:
    """Whether the stall torques of all wheels together are more than the pull of the slope, up or down; elementwise.

    Uphill a rover without that does not climb, whatever the soil does; downhill it coasts.
    """
    ratio = torque_ratio_of(rover, regolith, mass_kg, torque_nm)
    return np.asarray(rover.wheels * ratio > np.abs(np.sin(slope_rad)))
