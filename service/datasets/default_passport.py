"""What is assumed of an upload that does not say what was simulated."""

from __future__ import annotations

from service.datasets.passport import REAR_WHEEL, SLOPE_FRAME, Drive, Passport, Rover, Soil

# As in the passport of the shipped runs: Chrono's VIPER with RealWheel on "lunar regolith, Apollo LRV values".
VIPER_ON_LUNAR_REGOLITH = Passport(
    format="rover-twin-passport/1",
    title="assumed: VIPER straight up a lunar regolith slope",
    gravity_m_s2=1.62,
    frame=SLOPE_FRAME,
    reference_body=REAR_WHEEL,
    rover=Rover(
        wheel_radius_m=0.25,
        wheelbase_m=1.2836,
        track_m=1.2196,
        wheels=4,
        centre_of_mass_ahead_of_rear_axle_m=0.6277,
        centre_of_mass_above_surface_m=0.748,
        stock_mass_kg=434.9,
    ),
    soil=Soil(
        name="lunar regolith, Apollo LRV values",
        bekker_kphi=820000.0,
        bekker_kc=1400.0,
        bekker_n=1.0,
        mohr_cohesion_pa=170.0,
        mohr_friction_deg=35.0,
        janosi_shear_m=0.0178,
    ),
    drive=Drive(
        law="DC motor per wheel: torque = torque_nm * (1 - omega/omega0) for 0 <= omega <= omega0",
        no_load_speed_rad_s=3.141592653589793,
    ),
)
