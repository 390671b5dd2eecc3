"""Scenarios as the resistance process sees them. The formulas are in `native/scenario.c`."""

from __future__ import annotations

from ctypes import byref

import numpy as np

from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.library import Gate, address, contiguous, library
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import torque_ratio


def scaled_features(
    scenarios: Scenarios, rover: RoverParameters, regolith: RegolithParameters, hyper: Hyperparameters
) -> Array:
    """((tan th - 0.27)/0.19, ln(q/0.32)/0.55, ln(m/m_ref)/0.33), shape (scenario, 3); q as in `torque_ratio`."""
    columns = scenarios.slope_angle_rad, scenarios.mass_kg, torque_ratio(rover, regolith, scenarios)
    angle, mass, ratio = (contiguous(column) for column in columns)
    scaled = np.empty((len(mass), 3))
    library().rover_scaled_features(
        len(mass), address(angle), address(mass), address(ratio), hyper.reference_mass_kg, address(scaled)
    )
    return scaled


def stall_gate(scaled: Array, margins: Array, hyper: Hyperparameters) -> Array:
    """How near to stalling: a sigmoid of the drive margin, 0..1, of the shape of `margins`; `scaled` has (..., 3).

    Raises ValueError for shapes that do not fit.
    """
    features, margin = contiguous(scaled), contiguous(margins)
    if features.shape != (*margin.shape, 3):
        raise ValueError(f"features of shape {features.shape} do not fit margins of shape {margin.shape}")
    gate = np.empty_like(margin)
    library().rover_stall_gate(
        byref(compiled_gate(hyper)), gate.size, address(features), address(margin), address(gate)
    )
    return gate


def compiled_gate(hyper: Hyperparameters) -> Gate:
    """What the engine makes the stall gate of."""
    return Gate(hyper.gate_margin, hyper.gate_torque, hyper.gate_mass, hyper.gate_width)
