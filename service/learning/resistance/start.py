"""How a run starts: speed and height at release. With the wheels locked they depend on slope and mass only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.learning.resistance.kernels import matern52
from service.physics.scenario import Array

# Signal and noise deviations of (speed in m/s, height in m); lengths in units of `start_features`. Chosen by
# leave-one-run-out on the shipped runs: 1.3 mm/s and 0.065 mm rms there.
_SIGNAL, _NOISE = np.array([0.06, 0.005]), np.array([0.0007, 0.0001])
_LENGTHS = np.array([1.2, 6.0])


def start_features(angle_rad: Array, log_mass_scaled: Array) -> Array:
    """(slope - 15 deg)/10 deg and the scaled log mass; shape (scenario, 2)."""
    return np.stack([(np.degrees(angle_rad) - 15.0) / 10.0, log_mass_scaled], axis=-1)


def _shape(one: Array, two: Array) -> Array:
    (one_slope, one_mass), (two_slope, two_mass) = (one / _LENGTHS).T, (two / _LENGTHS).T
    distance = np.square(one_slope[:, None] - two_slope)
    distance += np.square(one_mass[:, None] - two_mass)
    shape = matern52(np.sqrt(distance, out=distance))
    shape += 1.0 + one @ two.T
    return np.asarray(shape)


@dataclass(frozen=True, slots=True, eq=False)
class StartProcess:
    """Two processes over the same runs: `features` (run, 2), `weights` (run, 2), `mean` (2,) for (speed, height)."""

    features: Array
    weights: Array
    mean: Array

    def at(self, features: Array) -> tuple[float, float]:
        """Speed (m/s) and height (m) at release for features of shape (2,)."""
        speed, height = self.mean + _shape(features[None, :], self.features)[0] @ self.weights
        return float(speed), float(height)

    def at_many(self, features: Array) -> tuple[Array, Array]:
        """The same for features of shape (scenario, 2); each answer has shape (scenario,)."""
        speed, height = (self.mean + _shape(features, self.features) @ self.weights).T
        return speed, height


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
