"""Scenarios as the resistance process sees them."""

from __future__ import annotations

import numpy as np

from service.learning.resistance.hyperparameters import Hyperparameters
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import torque_ratio

# Middle and spread of the shipped runs, so that lengths of one are of one kind: tan(slope), ln(torque ratio), ln(mass).
_TANGENT_MIDDLE, _TANGENT_SPREAD = 0.27, 0.19
TORQUE_MIDDLE, TORQUE_SPREAD = 0.32, 0.55
MASS_SPREAD = 0.33
_LEAST_TORQUE_RATIO = 1e-9


def scaled_features(
    scenarios: Scenarios, rover: RoverParameters, regolith: RegolithParameters, hyper: Hyperparameters
) -> Array:
    """((tan th - 0.27)/0.19, ln(q/0.32)/0.55, ln(m/m_ref)/0.33), shape (scenario, 3); q as in `torque_ratio`."""
    ratio = np.maximum(torque_ratio(rover, regolith, scenarios), _LEAST_TORQUE_RATIO)
    return np.stack(
        [
            (np.tan(scenarios.slope_angle_rad) - _TANGENT_MIDDLE) / _TANGENT_SPREAD,
            np.log(ratio / TORQUE_MIDDLE) / TORQUE_SPREAD,
            np.log(scenarios.mass_kg / hyper.reference_mass_kg) / MASS_SPREAD,
        ],
        axis=-1,
    )


def slope_angle_rad(scaled: Array) -> Array:
    """The slope angle (rad) of scaled features, shape (scenario,)."""
    return np.asarray(np.arctan(scaled[:, 0] * _TANGENT_SPREAD + _TANGENT_MIDDLE))


def mass_kg(scaled: Array, hyper: Hyperparameters) -> Array:
    """The mass (kg) of scaled features, shape (scenario,)."""
    return np.asarray(hyper.reference_mass_kg * np.exp(scaled[:, 2] * MASS_SPREAD))


def stall_gate(scaled: Array, margins: Array, hyper: Hyperparameters) -> Array:
    """How near to stalling: a sigmoid of the drive margin, 0..1, shape (scenario,)."""
    threshold = hyper.gate_margin + hyper.gate_torque * TORQUE_SPREAD * scaled[:, 1]
    threshold = threshold + hyper.gate_mass * MASS_SPREAD * scaled[:, 2]
    exponent = np.clip((margins - threshold) / hyper.gate_width, -700.0, 700.0)
    return np.asarray(1.0 / (1.0 + np.exp(exponent)), dtype=np.float64)
