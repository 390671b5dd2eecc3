"""Static sinkage of a rigid wheel in Bekker soil."""

from __future__ import annotations

import numpy as np

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios


def static_sinkage_m(rover: RoverParameters, regolith: RegolithParameters, scenarios: Scenarios) -> Array:
    """Depth (m) at which the soil carries one wheel's share of the weight; shape (scenario,).

    Bekker's rigid wheel on soil with pressure (k_c/b + k_phi) z**n (Wong, Theory of Ground Vehicles, 4th ed.,
    eq. 2.57; W is the load of one wheel, b its width, D its diameter):

        z = [ 3 W / (b (3 - n) (k_c/b + k_phi) sqrt(D)) ] ** (2 / (2 n + 1)),   valid for n < 3
    """
    load = scenarios.mass_kg * regolith.gravity_m_s2 * np.cos(scenarios.slope_angle_rad) / rover.wheels
    stiffness = regolith.bekker_kc / rover.wheel_width_m + regolith.bekker_kphi
    diameter = 2.0 * rover.wheel_radius_m
    n = regolith.bekker_n
    base = 3.0 * load / (rover.wheel_width_m * (3.0 - n) * stiffness * np.sqrt(diameter))
    return np.asarray(base ** (2.0 / (2.0 * n + 1.0)), dtype=np.float64)
