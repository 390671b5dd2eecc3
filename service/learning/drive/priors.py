"""What is believed of a law's numbers before runs are seen: a mean and a deviation for each, in the fit's own units.

The fit works in numbers that are standard normal beforehand: a parameter is mean + deviation y, or, where only positive
values mean anything, mean exp(deviation y). Means are rounded from fits to the shipped runs; deviations say how far a
user's own runs may move them. Weights of the bases are whitened, so that the functions they make have the deviations
below wherever runs may be.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from service.learning.drive.law import PARAMETERS, Basis
from service.physics.scenario import Array

MOTION_DEVIATION, RUT_DEVIATION, STALL_DEVIATION = 0.018, 0.012, 0.008  # fractions of the weight
_MOST_LOG = 3.0  # a positive parameter stays within exp(+-3) of its mean
_JITTER = 1e-4


class Prior(NamedTuple):
    """Mean, deviation (0: not fitted) and whether it is the logarithm that is normal."""

    mean: float
    deviation: float
    positive: bool = False


_PRIORS: dict[str, Prior] = {
    "front_adhesion": Prior(0.14, 0.045),
    "front_plateau": Prior(0.32, 0.45, True),
    "front_slip_scale": Prior(0.25, 0.6, True),
    "front_load_exponent": Prior(0.8, 0.45),
    "front_linear": Prior(0.6, 0.45),
    "rear_adhesion": Prior(0.17, 0.045),
    "rear_plateau": Prior(0.82, 0.225, True),
    "rear_slip_scale": Prior(0.25, 0.45, True),
    "rear_load_exponent": Prior(0.3, 0.3),
    "rear_linear": Prior(-0.05, 0.15),
    "rut_adhesion": Prior(0.11, 0.045),
    "rut_plateau": Prior(0.65, 0.3, True),
    "rut_slip_scale": Prior(0.07, 0.6, True),
    "rut_load_exponent": Prior(0.6, 0.45),
    "rut_slip_shift": Prior(0.0, 0.03),
    "compaction": Prior(1.2, 0.75, True),
    "compaction_exponent": Prior(0.0, 0.45),
    "compaction_bend": Prior(0.2, 0.45),
    "compaction_adhesion": Prior(0.06, 0.06),
    "share_shift": Prior(0.0, 0.03),
    "height_rise_m": Prior(0.076, 0.03),
    "rut_begin_m": Prior(0.9, 0.075),
    "rut_end_m": Prior(1.25, 0.12),
    "front_in_rut": Prior(0.0, 0.6),
    "shear_lack": Prior(0.25, 0.6, True),
    "shear_slip_m": Prior(0.07, 0.6, True),
    "backing_relief": Prior(0.18, 0.45, True),
    "backing_length_m": Prior(0.4, 0.6, True),
    "resistance": Prior(0.13, 0.03),
    "rut_resistance": Prior(0.12, 0.03),
    "compaction_resistance": Prior(0.02, 0.03),
    "front_rut_resistance": Prior(0.03, 0.045),
    "speed_resistance": Prior(0.0, 0.03),
    "mass_exponent": Prior(0.0, 0.15),
    "dig_length_m": Prior(0.3, 0.2, True),
    "dig_0": Prior(-0.05, 0.025),
    "dig_1": Prior(0.0, 0.015),
    "dig_2": Prior(0.0, 0.025),
    "dig_3": Prior(0.0, 0.015),
    "near": Prior(0.0, 0.05),
    "near_length_m": Prior(0.04, 0.2, True),
    "far": Prior(0.0, 0.025),
    "far_length_m": Prior(0.25, 0.2, True),
    "turning_speed_m_s": Prior(0.03, 0.6, True),
    "free_resistance": Prior(0.135, 0.015),
    "free_rut_relief": Prior(0.15, 0.15),
    "free_ratio": Prior(0.02, 0),
    "back_resistance": Prior(0.145, 0.008),
    "back_rut_relief": Prior(0.1, 0.04),
    "back_spin_relief": Prior(0.18, 0.16, True),
    "back_spin_m_s": Prior(0.08, 0.2, True),
    "back_hold_relief": Prior(0.02, 0.008),
    "back_hold_length_m": Prior(0.8, 0.16, True),
    "gate_speed_m_s": Prior(0.06, 0.03),
    "gate_width_m_s": Prior(0.02, 0.45, True),
    "slip_lag_m": Prior(0.08, 0.75, True),
    "brake_friction": Prior(0.5, 0.3, True),
    "brake_speed_m_s": Prior(0.006, 0.75, True),
}
# 7 numbers (constant, 3 linear, 3 quadratic) each: at 4 distances since standstill, at 3 places near where the rear
# wheels meet the ruts, and where the rover goes back.
_TERMS = {"early": (28, 0.06), "along": (21, 0.02), "back": (7, 0.02)}


@cache
def _table() -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Means, deviations, and which are logarithms, in the order of PARAMETERS. Raises KeyError if one has no prior."""
    terms = {
        f"{kind}_{at}": Prior(0.0, deviation * _shrunk(at % 7))
        for kind, (count, deviation) in _TERMS.items()
        for at in range(count)
    }
    priors = _PRIORS | terms
    rows = [priors[name] for name in PARAMETERS]
    return tuple(np.array(column) for column in zip(*rows, strict=True))  # type: ignore[return-value]


def _shrunk(number: int) -> float:
    """Of a constant, a linear or a quadratic one."""
    return 1.0 if number == 0 else 0.6 if number < 4 else 0.3


def fitted_parameters() -> npt.NDArray[np.intp]:
    """Which parameters a fit may move, as indices into PARAMETERS."""
    return np.flatnonzero(_table()[1] > 0)


def parameters_of(normal: Array) -> Array:
    """Parameters in their own units from standard-normal ones; both (..., parameter)."""
    mean, deviation, positive = _table()
    steps = deviation * normal
    return np.where(positive, mean * np.exp(np.clip(steps, -_MOST_LOG, _MOST_LOG)), mean + steps)


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """From standard-normal weights to a law's: the function they make then has the prior's deviation."""

    motion: Array
    stall: Array

    @classmethod
    def of(cls, motion: Basis, stall: Basis) -> Whitening:
        """Of these bases: the inverse of the factor of their bumps' covariance with each other."""
        return cls(_inverse_factor(motion), _inverse_factor(stall))

    def weights_of(self, normal: Array) -> Array:
        """A law's weights from standard-normal ones; both (..., 2 motion + stall)."""
        n = len(self.motion)
        parts = (
            MOTION_DEVIATION * normal[..., :n] @ self.motion,
            RUT_DEVIATION * normal[..., n : 2 * n] @ self.motion,
            STALL_DEVIATION * normal[..., 2 * n :] @ self.stall,
        )
        return np.concatenate(parts, axis=-1)


def _inverse_factor(basis: Basis) -> Array:
    apart = (basis.centres[:, None] - basis.centres[None]) / basis.lengths
    covariance = np.exp(-0.5 * np.square(apart).sum(axis=-1)) + _JITTER * np.eye(len(basis))
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
