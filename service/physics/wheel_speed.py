"""How fast the wheels turn: quasi-static balance of the motors against the slope and the soil.

At constant speed the motors' torque carries the weight's share along the slope and the motion resistance c m g cos th:

    n_w tau (1 - w/w0) / R_w = m g (sin th + c cos th)
    w = w0 (1 - m g R_w (sin th + c cos th) / (n_w tau)),   clipped to 0..w0

c is empirical: what driving the wheels through regolith costs, calibrated on runs that recorded wheel speeds.
"""

from __future__ import annotations

import numpy as np

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios

# N m of all wheels together: less is as good as none, and can be divided by
_LEAST_DRIVE_NM = 1e-9


def _weight_nm(rover: RoverParameters, regolith: RegolithParameters, scenarios: Scenarios) -> Array:
    """m g R_w, shape (scenario,)."""
    return scenarios.mass_kg * (regolith.gravity_m_s2 * rover.wheel_radius_m)


def wheel_speed_rad_s(
    rover: RoverParameters, regolith: RegolithParameters, resistance: float, scenarios: Scenarios
) -> Array:
    """w above, rad/s; shape (scenario,). Zero where the motors cannot hold the load."""
    angle = scenarios.slope_angle_rad
    load = np.sin(angle) + resistance * np.cos(angle)
    drive = rover.wheels * scenarios.torque_nm
    left = (drive - _weight_nm(rover, regolith, scenarios) * load) / np.maximum(drive, _LEAST_DRIVE_NM)
    return np.asarray(rover.no_load_speed_rad_s * np.minimum(np.maximum(left, 0.0), 1.0))


def motion_resistance_at(
    rover: RoverParameters, regolith: RegolithParameters, scenario: Scenarios, speed_rad_s: float
) -> float:
    """The c for which a single scenario's wheels turn at `speed_rad_s`: inverse of `wheel_speed_rad_s`."""
    angle = float(scenario.slope_angle_rad[0])
    drive = rover.wheels * float(scenario.torque_nm[0])
    load = (1.0 - speed_rad_s / rover.no_load_speed_rad_s) * drive / float(_weight_nm(rover, regolith, scenario)[0])
    return float((load - np.sin(angle)) / np.cos(angle))


def slip_ratio(rover: RoverParameters, speed_m_s: float, wheel_speed: float) -> float | None:
    """1 - v / (R_w w) (Wong, Theory of Ground Vehicles): 0 rolls, 1 spins on the spot, above 1 slides back.

    None where the wheels do not turn.
    """
    return None if wheel_speed <= 0 else 1.0 - speed_m_s / (rover.wheel_radius_m * wheel_speed)
