"""Where the bases' bumps stand: spread over what the runs go through, each as far from the others as can be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from service.learning.drive.law import Basis, scaled_features
from service.learning.drive.observations import Observation
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array

# Chosen by leave-one-run-out on the shipped runs among the settings of docs/fidelity.md, in units of `scaled_features`.
MOTION_LENGTHS, STALL_LENGTHS = (1.2, 1.5, 2.5), (0.6, 0.7, 1.5)
MOTION_BUMPS, STALL_BUMPS = 40, 24
_MARGIN = 0.25  # of scaled features past the runs
_STEEP = 1.0  # scaled slope (25 deg) from which a rover may stall


def bases_of(
    observed: Sequence[Observation], rover: RoverParameters, regolith: RegolithParameters
) -> tuple[Basis, Basis]:
    """The bases of the moving rover's resistance and of the stuck rover's."""
    met = np.concatenate([_met(each, rover, regolith) for each in observed])
    steep = met[met[:, 0] > _STEEP]
    if not len(steep):
        steep = met[[int(met[:, 0].argmax())]]
    middle = int(np.square(met).sum(axis=1).argmin())
    return (
        Basis(_spread(met, MOTION_BUMPS, np.array(MOTION_LENGTHS), middle), np.array(MOTION_LENGTHS)),
        Basis(_spread(steep, STALL_BUMPS, np.array(STALL_LENGTHS), 0), np.array(STALL_LENGTHS)),
    )


def reach_of(observed: Sequence[Observation], rover: RoverParameters, regolith: RegolithParameters) -> Array:
    """Lowest and highest of each scaled feature that the runs met, and a little more, (3, 2)."""
    met = np.concatenate([_met(each, rover, regolith) for each in observed])
    return np.stack([met.min(axis=0) - _MARGIN, met.max(axis=0) + _MARGIN], axis=-1)


def _met(one: Observation, rover: RoverParameters, regolith: RegolithParameters) -> Array:
    """Scaled features of every slope of a run's track with every torque of its controls, (combination, 3)."""
    controls, track = one.swept.controls, one.swept.track
    torques = np.unique(controls.torque_nm[np.asarray(controls.brake) == 0])
    # a track that was read off a run has many knots: its ends and some between
    slopes = track.slope_rad[np.unique(np.linspace(0, len(track.slope_rad) - 1, 6).round().astype(int))]
    weight = one.swept.mass_kg * regolith.gravity_m_s2 * rover.wheel_radius_m
    slope, torque = (each.ravel() for each in np.meshgrid(slopes, torques))
    return scaled_features(slope, torque / weight, np.full(len(slope), one.swept.mass_kg))


def _spread(points: Array, count: int, lengths: Array, first: int) -> Array:
    """Up to `count` points, each the furthest from those before it."""
    scaled = points / lengths
    chosen = [first]
    nearest = np.square(scaled - scaled[first]).sum(axis=1)
    while len(chosen) < count and nearest.max() > 1e-6:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.square(scaled - scaled[chosen[-1]]).sum(axis=1))
    return points[chosen]
