"""Prior `motor_slope`: the whole rover on a rigid slope, driven by DC motors; linear in speed, closed solution.

Each of the n_w wheels gives the torque of Chrono's VIPER motor, falling linearly from the stall torque tau to
zero at the no-load speed w0. Rolling without slip (wheel spin = v/R_w), along the slope:

    m dv/dt = (n_w tau / R_w) (1 - v / (R_w w0)) - m g sin th - c m g cos th

c is a constant motion-resistance coefficient that stands for what regolith takes. With

    a0 = n_w tau / (m R_w) - g (sin th + c cos th)      acceleration at rest
    k  = n_w tau / (m R_w**2 w0)                        rate of the motor's self-braking

this is dv/dt = a0 - k v. From rest, v = (a0/k) (1 - exp(-k t)), and integrating once more

    x = a0 t**2 E(k t),    E(z) = (z - 1 + exp(-z)) / z**2,   E(0) = 1/2

so x -> a0 t**2 / 2 without a speed limit (w0 infinite) or without a motor (tau = 0), and v -> a0/k, the
terminal speed, as t grows. The linear law is kept below zero and above w0, where the real motor is clipped.
The wheel centre rides at y = R_w - z_s with Bekker's static sinkage z_s (`sinkage.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.sinkage import static_sinkage_m

_SERIES_BELOW = (
    0.1  # under this the closed form of E loses digits to cancellation; the series is exact to rounding there
)


def travel_factor(z: Array) -> Array:
    """E(z) = (z - 1 + exp(-z)) / z**2 for z >= 0, accurate to rounding also where z is small; any shape."""
    series = np.zeros_like(z)
    for n in range(12, 1, -1):  # sum over n >= 2 of (-z)**(n-2) / n!, by Horner: 1/2 (1 - z/3 (1 - z/4 (...)))
        series = (1.0 - z * series) / n
    safe = np.where(z < _SERIES_BELOW, 1.0, z)
    closed = (safe + np.expm1(-safe)) / safe**2
    return np.where(z < _SERIES_BELOW, series, closed)


@dataclass(frozen=True, slots=True)
class MotorSlope:
    """Our prior. `motion_resistance_coefficient` is c above, dimensionless."""

    rover: RoverParameters
    regolith: RegolithParameters
    motion_resistance_coefficient: float

    name: ClassVar[str] = "motor_slope"
    coefficient_name: ClassVar[str] = "motion_resistance_coefficient"

    @property
    def coefficient(self) -> float:
        """c, dimensionless."""
        return self.motion_resistance_coefficient

    def with_coefficient(self, coefficient: float) -> Self:
        """The same prior with another c."""
        return replace(self, motion_resistance_coefficient=coefficient)

    def acceleration_at_rest_m_s2(self, scenarios: Scenarios) -> Array:
        """a0 above; shape (scenario,)."""
        drive = self.rover.wheels * scenarios.torque_nm / (scenarios.mass_kg * self.rover.wheel_radius_m)
        sine, cosine = np.sin(scenarios.slope_angle_rad), np.cos(scenarios.slope_angle_rad)
        resistance = sine + self.motion_resistance_coefficient * cosine
        return np.asarray(drive - self.regolith.gravity_m_s2 * resistance, dtype=np.float64)

    def braking_rate_per_s(self, scenarios: Scenarios) -> Array:
        """k above; shape (scenario,). Zero for an infinite no-load speed or without torque."""
        speed = self.rover.wheel_radius_m**2 * self.rover.no_load_speed_rad_s
        return np.asarray(self.rover.wheels * scenarios.torque_nm / (scenarios.mass_kg * speed), dtype=np.float64)

    def terminal_speed_m_s(self, scenarios: Scenarios) -> Array:
        """a0/k, the speed the rover tends to; infinite (or nan at exact balance) where nothing brakes it."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.acceleration_at_rest_m_s2(scenarios) / self.braking_rate_per_s(scenarios)

    def acceleration_m_s2(self, scenarios: Scenarios, speed_m_s: Array) -> Array:
        """dv/dt = a0 - k v; shape (scenario,)."""
        return self.acceleration_at_rest_m_s2(scenarios) - self.braking_rate_per_s(scenarios) * speed_m_s

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """x from rest at the origin and y at the static sinkage; shape (scenario, time), metres."""
        time = np.atleast_2d(np.asarray(time_s, dtype=np.float64))
        rate = self.braking_rate_per_s(scenarios)[:, None]
        x = self.acceleration_at_rest_m_s2(scenarios)[:, None] * time**2 * travel_factor(rate * time)
        height = self.rover.wheel_radius_m - static_sinkage_m(self.rover, self.regolith, scenarios)
        return Positions(x, np.broadcast_to(height[:, None], x.shape).copy())
