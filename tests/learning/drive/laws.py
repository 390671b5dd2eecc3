"""A law whose numbers are about those that the shipped runs give, with bumps that do something."""

from __future__ import annotations

import numpy as np

from service.learning.drive.law import PARAMETERS, Basis, Law
from service.learning.drive.library import HEIGHTS
from service.physics.parameters import LUNAR_REGOLITH, VIPER

ROUGHLY = {
    "front_adhesion": 0.14,
    "front_plateau": 0.32,
    "front_slip_scale": 0.25,
    "front_load_exponent": 0.8,
    "front_linear": 0.6,
    "rear_adhesion": 0.17,
    "rear_plateau": 0.82,
    "rear_slip_scale": 0.25,
    "rear_load_exponent": 0.3,
    "rear_linear": -0.05,
    "rut_adhesion": 0.11,
    "rut_plateau": 0.65,
    "rut_slip_scale": 0.07,
    "rut_load_exponent": 0.6,
    "rut_slip_shift": 0.01,
    "compaction": 1.2,
    "compaction_exponent": 0.1,
    "compaction_bend": 0.2,
    "compaction_adhesion": 0.06,
    "height_rise_m": 0.076,
    "rut_begin_m": 0.9,
    "rut_end_m": 1.25,
    "front_in_rut": 0.2,
    "shear_lack": 0.25,
    "shear_slip_m": 0.07,
    "backing_relief": 0.18,
    "backing_length_m": 0.4,
    "resistance": 0.13,
    "rut_resistance": 0.12,
    "compaction_resistance": 0.02,
    "front_rut_resistance": 0.03,
    "mass_exponent": 0.1,
    "speed_resistance": 0.01,
    "dig_length_m": 0.3,
    "dig_0": -0.05,
    "dig_1": 0.02,
    "near": 0.05,
    "near_length_m": 0.04,
    "far": 0.03,
    "far_length_m": 0.25,
    "turning_speed_m_s": 0.03,
    "free_resistance": 0.135,
    "free_rut_relief": 0.15,
    "free_ratio": 0.02,
    "back_resistance": 0.145,
    "back_rut_relief": 0.1,
    "back_spin_relief": 0.18,
    "back_spin_m_s": 0.08,
    "back_hold_relief": 0.02,
    "back_hold_length_m": 0.8,
    "gate_speed_m_s": 0.06,
    "gate_width_m_s": 0.02,
    "slip_lag_m": 0.08,
    "brake_friction": 0.5,
    "brake_speed_m_s": 0.006,
}


def law_like_the_shipped_one(seed: int = 0, bumps: tuple[int, int] = (40, 24)) -> Law:
    rng = np.random.default_rng(seed)
    parameters = {name: ROUGHLY.get(name, 0.0) for name in PARAMETERS}
    for name in PARAMETERS:
        if name.startswith(("early", "along")):
            parameters[name] = float(rng.normal(0.0, 0.01))
    motion, stall = (rng.normal(size=(count, 3)) for count in bumps)
    return Law.of(
        VIPER,
        LUNAR_REGOLITH,
        parameters,
        Basis(motion, np.array([1.2, 1.5, 2.5])),
        Basis(stall + np.array([1.5, 0.0, 0.0]), np.array([0.6, 0.7, 1.5])),
        rng.normal(0.0, 0.01, 2 * bumps[0] + bumps[1]),
        rng.normal(0.0, 0.005, HEIGHTS),
    )
