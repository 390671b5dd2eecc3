"""How large an error to expect at a scenario, from the errors at the training runs around it.

With E_k(t) the largest left-out error of run k up to time t, d_k the distance to run k, d its smallest and s the
spacing of the runs:

    scale(t) = (0.3 median_k E_k(t) + geometric mean_k of E_k(t), weighted exp(-(d_k^2 - d^2) / 2 (1.5 s)^2))
               * (1 + (d / 2 s)^2)

A geometric mean, since errors span millimetres to metres and an arithmetic one would be that of the worst run nearby.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from service.learning.neighbourhood import nearest_other
from service.physics.scenario import Array

# Tried on left-out predictions of the 80 shipped Chrono runs: bandwidths 0.7 to 2, floors 0.3 and 1, growth 0 to 1 per
# spacing squared, arithmetic and geometric means. All cover alike; these give the narrowest band where rovers climb.
_BANDWIDTH = 1.5
_FLOOR_SHARE = 0.3
_GROWTH = 0.25
_SMALLEST_SPACING = 0.05  # of the scaled distance: runs that repeat each other must not make everything else far
_ALMOST_NOTHING_M = 1e-5  # keeps the logarithm of errors that are zero at t = 0 finite
_RESOLUTION_M = 1e-6  # no simulation is better


@dataclass(frozen=True, slots=True, eq=False)
class ErrorScale:
    """`places` (run, coordinate) of the training runs, `envelope_m` (2, run, time) of their errors in x and y.

    `spacing` is the median distance of a run to the nearest other one.
    """

    places: Array
    envelope_m: Array
    spacing: float
    _log_envelope: Array = field(init=False, repr=False)
    _floor_m: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        floor = _FLOOR_SHARE * np.median(self.envelope_m, axis=1, keepdims=True) + _RESOLUTION_M
        object.__setattr__(self, "_log_envelope", np.log(self.envelope_m + _ALMOST_NOTHING_M))
        object.__setattr__(self, "_floor_m", floor)

    @classmethod
    def of(cls, places: Array, envelope_m: Array) -> ErrorScale:
        """The scale that these runs make; at least two of them."""
        spacing = max(float(np.median(nearest_other(places))), _SMALLEST_SPACING)
        return cls(places, envelope_m, spacing)

    def at(self, places: Array) -> Array:
        """The expected error (m) at other places (place, coordinate), shape (2, place, time). Never shrinks in time."""
        return self._between(places, np.zeros((len(places), len(self.places)), dtype=np.bool_))

    def left_out(self) -> Array:
        """The same at each run's own place, made from the other runs only; shape (2, run, time)."""
        return self._between(self.places, np.eye(len(self.places), dtype=np.bool_))

    def without(self, run: int) -> ErrorScale:
        """The scale that the other runs make."""
        return ErrorScale.of(np.delete(self.places, run, axis=0), np.delete(self.envelope_m, run, axis=1))

    def _between(self, places: Array, ignored: npt.NDArray[np.bool_]) -> Array:
        squared = ((places[:, None] - self.places) ** 2).sum(axis=2)
        squared[ignored] = np.inf
        nearest = squared.min(axis=1, keepdims=True)
        weights = np.exp((nearest - squared) / (2.0 * (_BANDWIDTH * self.spacing) ** 2))
        weights /= weights.sum(axis=1, keepdims=True)
        around = np.exp(weights @ self._log_envelope) - _ALMOST_NOTHING_M
        # rounding may give a geometric mean of zeros that is just below zero
        return np.asarray((self._floor_m + np.maximum(around, 0.0)) * (1.0 + _GROWTH * nearest / self.spacing**2))
