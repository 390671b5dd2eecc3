"""What a solved process keeps: per training run, its weighted kernels over travel and time, at knots.

The prediction for a scenario is a sum over training points of weight x scenario kernel x travel or time kernel. The
scenario kernel is the same for all points of a run, so their sums can be taken once: tables of shape (run, knot).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.learning.curves import interpolate_curves
from service.learning.resistance.integrate import TRAVEL_STEP_M
from service.learning.resistance.kernels import ScenarioKernels, rut_plateau
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

    def over_travel(self, kernels: ScenarioKernels, knots: Index | slice = slice(None)) -> Array:
        """`along_travel` of all scenarios, at all or some of TRAVEL_KNOTS_M; shape (scenario, knot)."""
        travel, plateau = self.travel[:, knots], _PLATEAU[knots]
        weights = np.column_stack([kernels.travel, kernels.level @ self.level, kernels.rut @ self.rut])
        return np.asarray(weights @ np.vstack([travel, np.ones_like(plateau), plateau]))

    def over_time(self, time_s: Array, knots_s: Array, kernels: ScenarioKernels) -> Array:
        """`along_time` of all scenarios, read at `time_s` of shape (point,); shape (scenario, point)."""
        found = kernels.release @ interpolate_curves(time_s, knots_s, self.release)
        found += kernels.stall @ interpolate_curves(time_s, knots_s, self.stall)
        return np.asarray(found)


@dataclass(frozen=True, slots=True, eq=False)
class KnotCells:
    """Finds places between knots (m) that are multiples of `step_m`, which need not be uniform, without a search.

    Of each cell of the uniform grid: the `knot` at or before it, how many cells `left` of it that is, and the
    `inverse` of the cells from that knot to the next one.
    """

    first_m: float
    step_m: float
    knot: Index
    left: Array
    inverse: Array

    @classmethod
    def of(cls, knots_m: Array, step_m: float) -> KnotCells:
        """For rising knots."""
        numbers = np.round((knots_m - knots_m[0]) / step_m).astype(np.intp)
        widths = np.diff(numbers)
        knot = np.repeat(np.arange(len(widths)), widths)
        return cls(float(knots_m[0]), step_m, knot, numbers[knot].astype(np.float64), 1.0 / widths[knot])

    def read(self, travel_m: Array, tables: Array) -> Array:
        """Tables (scenario, knot) at places (scenario, place): straight between knots, held past their ends."""
        found = np.empty(travel_m.shape)
        rows, knots = np.arange(len(tables))[:, None], tables.shape[1]
        flat = tables.ravel()
        for some in (slice(at, at + _ROWS_AT_ONCE) for at in range(0, len(tables), _ROWS_AT_ONCE)):
            place = (travel_m[some] - self.first_m) * (1.0 / self.step_m)
            np.maximum(place, 0.0, out=place)
            np.minimum(place, float(len(self.knot)), out=place)
            cell = np.minimum(place.astype(np.intp), len(self.knot) - 1)
            place -= self.left.take(cell)
            place *= self.inverse.take(cell)
            at_knot = self.knot.take(cell)
            at_knot += rows[some] * knots
            low = flat.take(at_knot)
            at_knot += 1
            rise = flat.take(at_knot)
            rise -= low
            rise *= place
            np.add(low, rise, out=found[some])
        return found


_PLATEAU = rut_plateau(TRAVEL_KNOTS_M)
_ROWS_AT_ONCE = 64  # so that what is computed on the way stays in cache
TRAVEL_CELLS = KnotCells.of(TRAVEL_KNOTS_M, 0.0025)
# TRAVEL_GRID_M holds more points than the tables bend at: these knots say the same.
GRID_KNOTS: Index = np.flatnonzero(np.isclose(TRAVEL_KNOTS_M / TRAVEL_STEP_M, np.round(TRAVEL_KNOTS_M / TRAVEL_STEP_M)))
GRID_CELLS = KnotCells.of(TRAVEL_KNOTS_M[GRID_KNOTS], TRAVEL_STEP_M)
