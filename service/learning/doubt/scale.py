"""How large an error to expect at a place, from the runs that came near it.

With e_k the size of run k's error, d_k the distance to it, d the smallest of these:

    scale = geometric mean of e_k, weighted exp(-(d_k^2 - d^2) / 2), times (1 + d^2 / 10), plus 0.3 median of e_k

A geometric mean, since errors span three powers of ten and an arithmetic one would be that of the worst run nearby.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from service.learning.neighbourhood import FEW, Points, chunks
from service.physics.scenario import Array

_FLOOR_SHARE, _GROWTH, _MOST_GROWTH = 0.3, 0.1, 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """Places (run, coordinate) and sizes (kind, run) of errors, each kind by itself, all positive."""

    places: Array
    sizes: Array
    _logarithms: Array = field(init=False, repr=False)
    _floor: Array = field(init=False, repr=False)
    _points: Points = field(init=False, repr=False)

    def __post_init__(self) -> None:
        with np.errstate(invalid="ignore", divide="ignore"):  # whoever reads it from a file checks it first
            object.__setattr__(self, "_logarithms", np.log(self.sizes))
        object.__setattr__(self, "_points", Points.of(self.places))
        object.__setattr__(self, "_floor", _FLOOR_SHARE * np.median(self.sizes, axis=1))

    def at(self, places: Array) -> Array:
        """Sizes to expect, (kind, place)."""
        found = np.empty((len(self.sizes), len(places)))
        for rows in chunks(len(places), FEW * len(self.places)):
            squared = self._points.squared_distances(places[rows])
            least = squared.min(axis=1)
            weights = np.exp(0.5 * (least[:, None] - squared))
            mean = self._logarithms @ weights.T / weights.sum(axis=1)
            growth = 1.0 + np.minimum(_GROWTH * least, _MOST_GROWTH)
            found[:, rows] = np.exp(mean) * growth + self._floor[:, None]
        return found


def kernel(squared: Array) -> Array:
    """How much each run counts at each place, (place, run), by squared distances; rows add up to 1."""
    weights = np.exp(0.5 * (squared.min(axis=1, keepdims=True) - squared))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
