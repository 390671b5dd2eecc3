"""How fast a parked rover creeps when its wheels are released: a smooth function of slope and mass, of fixed size."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from service.learning.drive.library import CompiledRelease, address, contiguous, library
from service.learning.drive.recorded import start_speed
from service.learning.observed import ObservedRun
from service.physics.scenario import Array

# Bumps over the slope (deg) and ln(mass / 550 kg); of the nine shipped sets, eight folds by whole runs leave 0.4
# mm/s in the median and 1.7 in the 90th percentile; 91 at the steepest way down, which no other run is near.
_SLOPES_DEG, _SLOPE_LENGTH_DEG = np.arange(-30.0, 36.0, 3.0), 5.0
_LOG_MASSES, _MASS_LENGTH = np.array([-0.6, 0.0, 0.6]), 0.8
_DEVIATION_M_S, _NOISE_M_S = 0.05, 0.0015
_JITTER = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class StartSpeeds:
    """`weights` (bump,), and what slopes (rad) and masses (kg) are held within: there is no run beyond."""

    weights: Array
    slope_rad: tuple[float, float]
    mass_kg: tuple[float, float]
    _compiled: CompiledRelease = field(init=False, repr=False)
    _address: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", contiguous(self.weights))
        object.__setattr__(self, "_compiled", self._laid_out())
        object.__setattr__(self, "_address", ctypes.addressof(self._compiled))

    @classmethod
    def of(cls, runs: Sequence[ObservedRun]) -> StartSpeeds:
        """Of these runs, by ridge regression: the posterior mean of a Gaussian process with the bumps' covariance."""
        slope = np.array([float(run.slope_angle_rad[0]) for run in runs])
        mass = np.array([run.mass_kg for run in runs])
        speed = np.array([start_speed(run) for run in runs])
        bumps = _bumps(slope, mass) @ _whitening()
        ridge = (_NOISE_M_S / _DEVIATION_M_S) ** 2
        weights = np.linalg.solve(bumps.T @ bumps + ridge * np.eye(bumps.shape[1]), bumps.T @ speed)
        ends = (float(slope.min()), float(slope.max())), (float(mass.min()), float(mass.max()))
        return cls(_whitening() @ weights, *ends)

    def at(self, slope_rad: Array, mass_kg: Array) -> Array:
        """Speeds (m/s), shape (scenario,), positive uphill."""
        slopes, masses = contiguous(slope_rad), contiguous(mass_kg)
        found, release = np.empty(len(slopes)), self.compiled()
        library().rover_release_speeds(
            ctypes.addressof(release), len(slopes), address(slopes), address(masses), address(found)
        )
        return found

    def compiled(self) -> CompiledRelease:
        """As the engine has it, as long as this is kept."""
        return self._compiled

    @property
    def address(self) -> int:
        """Where the engine finds `compiled`."""
        return self._address

    def _laid_out(self) -> CompiledRelease:
        return CompiledRelease(
            len(_SLOPES_DEG),
            len(_LOG_MASSES),
            _SLOPE_LENGTH_DEG,
            _MASS_LENGTH,
            self.slope_rad,
            self.mass_kg,
            address(_SLOPES_DEG),
            address(_LOG_MASSES),
            address(self.weights),
        )


def bump_count() -> int:
    """How many weights there are."""
    return len(_SLOPES_DEG) * len(_LOG_MASSES)


def _bumps(slope_rad: Array, mass_kg: Array) -> Array:
    along = np.exp(-0.5 * np.square((np.degrees(slope_rad)[:, None] - _SLOPES_DEG) / _SLOPE_LENGTH_DEG))
    heavy = np.exp(-0.5 * np.square((np.log(mass_kg / 550.0)[:, None] - _LOG_MASSES) / _MASS_LENGTH))
    return np.asarray((along[:, :, None] * heavy[:, None, :]).reshape(len(along), -1))


def _whitening() -> Array:
    slope, log_mass = (each.ravel() for each in np.meshgrid(np.radians(_SLOPES_DEG), _LOG_MASSES, indexing="ij"))
    covariance = _bumps(slope, 550.0 * np.exp(log_mass)) + _JITTER * np.eye(bump_count())
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)).T)
