"""What a solved process keeps: per training run, its weighted kernels over travel and time, at knots.

The prediction for a scenario is a sum over training points of weight x scenario kernel x travel or time kernel. The
scenario kernel is the same for all points of a run, so their sums can be taken once: tables of shape (run, knot).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.learning.resistance.kernels import ScenarioKernels, rut_plateau
from service.physics.scenario import Array

TRAVEL_KNOTS_M: Array = np.unique(
    np.concatenate(
        [
            np.linspace(-5.0, -0.5, 46),
            np.linspace(-0.5, -0.1, 41),
            np.linspace(-0.1, 0.15, 101),
            np.linspace(0.15, 1.0, 86),
            np.linspace(1.0, 1.5, 101),
            np.linspace(1.5, 2.2, 36),
            np.linspace(2.2, 8.0, 59),
        ]
    )
)


def time_knots(horizon_s: float) -> Array:
    """Dense after the release, 0.1 s apart from 2 s to the longest training run's end."""
    parts = [np.linspace(0.0, 0.5, 101), np.linspace(0.5, 2.0, 76), np.arange(2.0, max(horizon_s, 2.0) + 0.05, 0.1)]
    return np.unique(np.round(np.concatenate(parts), 9))


@dataclass(frozen=True, slots=True, eq=False)
class ResponseTables:
    """`level` and `rut` have shape (run,), `travel` (run, travel knot), `release` and `stall` (run, time knot)."""

    level: Array
    rut: Array
    travel: Array
    release: Array
    stall: Array

    def along_travel(self, kernels: ScenarioKernels, scenario: int = 0) -> Array:
        """The part that depends on the travel, at TRAVEL_KNOTS_M."""
        constant = kernels.level[scenario] @ self.level
        rut = (kernels.rut[scenario] @ self.rut) * _PLATEAU
        return np.asarray(constant + rut + kernels.travel[scenario] @ self.travel)

    def along_time(self, kernels: ScenarioKernels, scenario: int = 0) -> Array:
        """The part that depends on the time since release, at the time knots."""
        return np.asarray(kernels.release[scenario] @ self.release + kernels.stall[scenario] @ self.stall)


_PLATEAU = rut_plateau(TRAVEL_KNOTS_M)
