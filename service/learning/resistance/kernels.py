"""Kernels over scenarios, travel and time, and the scaled features that scenarios are compared by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from service.learning.resistance.hyperparameters import KernelHyperparameters
from service.learning.resistance.traction import smoothstep
from service.physics.scenario import Array

# Travel (m) is measured in steps of about equal change of the resistance: fine around the release and where the
# rear wheels enter the ruts, coarse beyond. Past the last knot nothing changes any more.
_TRAVEL_KNOTS = np.array(
    [-5, -1, -0.3, -0.1, -0.03, 0, 0.03, 0.08, 0.2, 0.5, 1.0, 1.1, 1.2, 1.3, 1.45, 1.7, 2.2, 3, 5, 8], dtype=np.float64
)
_TRAVEL_STEPS = [0, 0.8, 0.8, 0.7, 0.7, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.8, 0.8, 0.8, 0.6, 0.5, 0.4, 0.4, 0.2]
_WARPED_KNOTS = np.cumsum(_TRAVEL_STEPS)
_RELEASE_S, _STALL_S = 0.1, 0.5
_PLATEAU_START_M, _PLATEAU_LENGTH_M = 1.1, 0.4


class ScenarioKernels(NamedTuple):
    """Covariances between two sets of scenarios of the five parts, each of shape (scenario, scenario)."""

    level: Array
    travel: Array
    release: Array
    stall: Array
    rut: Array


@dataclass(frozen=True, slots=True)
class ScenarioFeatures:
    """Scaled features, shape (scenario, 3), and how near to stalling each scenario is, 0..1, shape (scenario,)."""

    scaled: Array
    gate: Array


def matern52(distance: Array) -> Array:
    """Matern kernel of order 5/2 (Rasmussen and Williams, Gaussian Processes for Machine Learning, eq. 4.17)."""
    scaled = np.sqrt(5.0) * distance
    polynomial = scaled / 3.0
    polynomial += 1.0
    polynomial *= scaled
    polynomial += 1.0
    polynomial *= np.exp(-scaled)
    return np.asarray(polynomial, dtype=np.float64)


def scenario_kernels(hyper: KernelHyperparameters, one: ScenarioFeatures, two: ScenarioFeatures) -> ScenarioKernels:
    """Squared-exponential kernels; level and travel add a linear one, the near-stall parts are gated on both sides."""
    lengths = (hyper.level_lengths, hyper.travel_lengths, hyper.release_lengths, hyper.rut_lengths, hyper.stall_lengths)
    inverse = 1.0 / np.square(lengths)
    squared = np.square(one.scaled.T[:, :, None] - two.scaled.T[:, None, :])
    exponents = (-0.5 * inverse) @ squared.reshape(3, -1)
    near = np.exp(exponents, out=exponents).reshape(len(lengths), len(one.scaled), len(two.scaled))
    for kernel, scales in zip(near[:2], inverse, strict=False):
        kernel += 1.0 + (one.scaled * scales) @ two.scaled.T
    stall = one.gate[:, None] * two.gate[None, :] * near[4]
    return ScenarioKernels(
        level=hyper.level_deviation**2 * near[0] + hyper.stall_level_deviation**2 * stall,
        travel=hyper.travel_deviation**2 * near[1] + hyper.stall_travel_deviation**2 * stall,
        release=hyper.release_deviation**2 * near[2],
        stall=hyper.stall_time_deviation**2 * stall,
        rut=hyper.rut_deviation**2 * near[3],
    )


def warped_travel(travel_m: Array) -> Array:
    """Travel in units in which the resistance changes evenly."""
    return np.asarray(np.interp(travel_m, _TRAVEL_KNOTS, _WARPED_KNOTS), dtype=np.float64)


def travel_kernel(hyper: KernelHyperparameters, one_m: Array, two_m: Array) -> Array:
    """Shape (one, two)."""
    distance = np.abs(warped_travel(one_m)[:, None] - warped_travel(two_m)[None, :])
    return matern52(distance / hyper.travel_length)


def release_kernel(hyper: KernelHyperparameters, one_s: Array, two_s: Array) -> Array:
    """Dies out with the time since release; shape (one, two)."""
    decay = np.exp(-one_s / hyper.release_decay_s)[:, None] * np.exp(-two_s / hyper.release_decay_s)[None, :]
    distance = np.abs(np.log1p(one_s / _RELEASE_S)[:, None] - np.log1p(two_s / _RELEASE_S)[None, :])
    return np.asarray(decay * matern52(distance / hyper.release_length))


def stall_time_kernel(hyper: KernelHyperparameters, one_s: Array, two_s: Array) -> Array:
    """Slow change while the wheels dig; shape (one, two)."""
    distance = np.abs(np.log1p(one_s / _STALL_S)[:, None] - np.log1p(two_s / _STALL_S)[None, :])
    return matern52(distance / hyper.stall_time_length)


def rut_plateau(travel_m: Array) -> Array:
    """0 before the rear wheels meet the ruts, 1 after, with which the rut part is multiplied."""
    return smoothstep((travel_m - _PLATEAU_START_M) / _PLATEAU_LENGTH_M)
