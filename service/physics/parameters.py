"""Rover and regolith parameters. They travel with every checkpoint; nothing else in the code knows these numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


def _require_positive(instance: object, *names: str) -> None:
    for name in names:
        value = getattr(instance, name)
        if math.isnan(value) or value <= 0:
            raise ValueError(f"{name} must be positive, got {value}")


@dataclass(frozen=True, slots=True)
class RoverParameters:
    """Geometry and drive of a four-wheeled rover, SI units. Raises ValueError for sizes that cannot be.

    `no_load_speed_rad_s` may be infinite: a motor whose torque does not fall with speed.
    `centre_of_mass_ahead_of_rear_axle_m` is the paper's L_r, `centre_of_mass_height_m` its h.
    """

    wheel_radius_m: float
    wheel_width_m: float
    wheelbase_m: float
    wheels: int
    centre_of_mass_ahead_of_rear_axle_m: float
    centre_of_mass_height_m: float
    no_load_speed_rad_s: float

    def __post_init__(self) -> None:
        _require_positive(self, *(field.name for field in fields(self)))
        if self.centre_of_mass_ahead_of_rear_axle_m >= self.wheelbase_m:
            raise ValueError("the centre of mass must lie between the axles")


@dataclass(frozen=True, slots=True)
class RegolithParameters:
    """Gravity and soil: Bekker pressure-sinkage and Mohr-Coulomb strength. Raises ValueError for impossible soil.

    Pressure under a plate of width b at sinkage z is (k_c/b + k_phi) z**n (Bekker 1969), with
    `bekker_kc` in N/m**(n+1) and `bekker_kphi` in N/m**(n+2).
    """

    gravity_m_s2: float
    bekker_kc: float
    bekker_kphi: float
    bekker_n: float
    cohesion_pa: float
    friction_angle_rad: float
    shear_modulus_m: float

    def __post_init__(self) -> None:
        _require_positive(self, "gravity_m_s2", "bekker_kphi", "bekker_n", "shear_modulus_m")
        if self.cohesion_pa < 0 or self.bekker_kc < 0:
            raise ValueError("cohesion_pa and bekker_kc must not be negative")
        if not 0 < self.friction_angle_rad < math.pi / 2:
            raise ValueError(f"friction_angle_rad must be in (0, pi/2), got {self.friction_angle_rad}")


VIPER = RoverParameters(
    # Passport of the shipped Chrono runs (chrono::viper::Viper with RealWheel), except the width.
    wheel_radius_m=0.25,
    wheelbase_m=1.2836,
    wheels=4,
    centre_of_mass_ahead_of_rear_axle_m=0.6277,
    centre_of_mass_height_m=0.748,
    no_load_speed_rad_s=math.pi,
    wheel_width_m=0.2,  # Chrono's demo_ROBOT_Viper_WheelSlope_CRM.cpp
)

LUNAR_REGOLITH = RegolithParameters(
    # Passport of the shipped Chrono runs: "lunar regolith, Apollo LRV values".
    gravity_m_s2=1.62,
    bekker_kc=1400.0,
    bekker_kphi=820000.0,
    bekker_n=1.0,
    cohesion_pa=170.0,
    friction_angle_rad=math.radians(35.0),
    shear_modulus_m=0.0178,
)
