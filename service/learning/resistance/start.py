"""How a run starts: speed and height at release. With the wheels locked they depend on slope and mass only.

The formulas of features and kernel are in `native/scenario.c`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.learning.resistance.library import address, contiguous, library
from service.physics.scenario import Array

# Signal and noise deviations of (speed in m/s, height in m); lengths in units of `start_features`. Chosen by
# leave-one-run-out on the shipped runs: 1.3 mm/s and 0.065 mm rms there.
_SIGNAL, _NOISE = np.array([0.06, 0.005]), np.array([0.0007, 0.0001])
INVERSE_LENGTHS = 1.0 / np.array([1.2, 6.0])


def start_features(angle_rad: Array, log_mass_scaled: Array) -> Array:
    """(slope - 15 deg)/10 deg and the scaled log mass; shape (scenario, 2)."""
    angle, mass = contiguous(angle_rad), contiguous(log_mass_scaled)
    if angle.shape != mass.shape or angle.ndim != 1:
        raise ValueError(f"angles of shape {angle.shape} do not fit masses of shape {mass.shape}")
    features = np.empty((len(angle), 2))
    library().rover_start_features(len(angle), address(angle), address(mass), address(features))
    return features


def _shape(one: Array, two: Array) -> Array:
    """A Matern kernel of order 5/2 and a linear one between features (one, 2) and (two, 2); shape (one, two).

    Raises ValueError for features of other shapes.
    """
    ones, twos = contiguous(one), contiguous(two)
    if ones.shape != (len(ones), 2) or twos.shape != (len(twos), 2):
        raise ValueError(f"start features must have shape (run, 2), got {ones.shape} and {twos.shape}")
    shape = np.empty((len(ones), len(twos)))
    library().rover_start_shape(
        address(INVERSE_LENGTHS), len(ones), address(ones), len(twos), address(twos), address(shape)
    )
    return shape


@dataclass(frozen=True, slots=True, eq=False)
class StartProcess:
    """Two processes over the same runs: `features` (run, 2), `weights` (run, 2), `mean` (2,) for (speed, height).

    For other features: mean + kernel @ weights, which the engine evaluates.
    """

    features: Array
    weights: Array
    mean: Array


def fit_start(features: Array, speed_m_s: Array, height_m: Array) -> tuple[StartProcess, list[StartProcess]]:
    """The process of all runs, and for each run the one as if fitted without it (same mean)."""
    targets = np.stack([speed_m_s, height_m], axis=-1)
    mean = targets.mean(axis=0)
    weights, without = np.empty_like(targets), np.empty((len(targets), *targets.shape))
    for column in range(2):
        noise = (_NOISE[column] / _SIGNAL[column]) ** 2
        inverse = np.linalg.inv(_shape(features, features) + noise * np.eye(len(features)))
        weights[:, column] = inverse @ (targets[:, column] - mean[column])
        without[:, :, column] = weights[:, column] - (inverse * (weights[:, column] / np.diag(inverse))).T
        without[np.arange(len(features)), np.arange(len(features)), column] = 0.0
    return StartProcess(features, weights, mean), [StartProcess(features, each, mean) for each in without]
