"""Prior `rigid_slope`: equations (1) and (2) of IAC-23-A3.IP.204, exactly as printed.

    m x'' = -m g [(L_r + h sin th)/L] sin th + mu_k m g [(L_r cos th + h sin th)/L] + tau/R_w      (1)
    y     = R_w                                                                                   (2)

th is the slope angle, tau the wheel torque, mu_k the friction coefficient, L the wheelbase, L_r the
distance of the centre of mass from the rear axle, h its height. As printed, the weight-share bracket
multiplies sin th, friction drives the rover uphill (it is traction), and one wheel's torque moves the
whole mass. The right-hand side is constant, so x = a t**2 / 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios


@dataclass(frozen=True, slots=True)
class RigidSlope:
    """The paper's prior. `friction_coefficient` is mu_k; the paper gives no value for it."""

    rover: RoverParameters
    regolith: RegolithParameters
    friction_coefficient: float

    name: ClassVar[str] = "rigid_slope"
    coefficient_name: ClassVar[str] = "friction_coefficient"

    @property
    def coefficient(self) -> float:
        """mu_k, dimensionless."""
        return self.friction_coefficient

    def with_coefficient(self, coefficient: float) -> Self:
        """The same prior with another mu_k."""
        return replace(self, friction_coefficient=coefficient)

    def acceleration_m_s2(self, scenarios: Scenarios, speed_m_s: Array) -> Array:
        """Equation (1) divided by m; shape (scenario,). It does not depend on the speed."""
        sine, cosine = np.sin(scenarios.slope_angle_rad), np.cos(scenarios.slope_angle_rad)
        gravity, wheelbase = self.regolith.gravity_m_s2, self.rover.wheelbase_m
        ahead = self.rover.centre_of_mass_ahead_of_rear_axle_m
        height = self.rover.centre_of_mass_height_m
        weight = -gravity * (ahead + height * sine) / wheelbase * sine
        friction = self.friction_coefficient * gravity * (ahead * cosine + height * sine) / wheelbase
        torque = scenarios.torque_nm / (self.rover.wheel_radius_m * scenarios.mass_kg)
        return weight + friction + torque + 0.0 * speed_m_s

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """x = a t**2 / 2 from rest at the origin, y = R_w; shape (scenario, time), metres."""
        time = np.atleast_2d(np.asarray(time_s, dtype=np.float64))
        acceleration = self.acceleration_m_s2(scenarios, np.zeros(len(scenarios)))[:, None]
        x = 0.5 * acceleration * time**2
        return Positions(x, np.full_like(x, self.rover.wheel_radius_m))
