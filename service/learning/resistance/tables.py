"""What a solved process keeps: per training run, its weighted kernels over travel and time, at knots.

The prediction for a scenario is a sum over training points of weight x scenario kernel x travel or time kernel. The
scenario kernel is the same for all points of a run, so their sums can be taken once: tables of shape (run, knot).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array

Index = npt.NDArray[np.intp]

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
HEIGHT_STEP_M = 0.0025  # all knots are multiples of it
# The resistance bends at multiples of this step only: the uniform grid on which the ruts are blended in.
TRAVEL_STEP_M = 0.01
GRID_KNOTS: Index = np.flatnonzero(np.isclose(TRAVEL_KNOTS_M / TRAVEL_STEP_M, np.round(TRAVEL_KNOTS_M / TRAVEL_STEP_M)))
TRAVEL_GRID_M: Array = np.arange(-500, 801) * np.float64(TRAVEL_STEP_M)


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
