"""What left-out runs tell: where each was, how much its model erred, and what the others lead one to expect there."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from service.learning.doubt.excursions import Excursion, excursions
from service.learning.doubt.meeting import OffsetModel, scenario_places
from service.learning.doubt.multipliers import COAST, DRIVE, UPHILL, Kinds
from service.learning.doubt.outcomes import Borders
from service.learning.doubt.scale import Scale, kernel
from service.learning.observed import ObservedRun
from service.physics.scenario import Array

_LEAST_SIZE, _LEAST_Y_M = 0.25, 0.001  # in units of excursions.UNIT_OFFSET; no simulation is better
_COUNTS = 0.02  # leaving out a run with a smaller share in a scale leaves that as it is


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Left-out runs. `places` has those that each came through: one for a constant run, some for a drive.

    `base` are the rows that scales are made of: constant runs, each at one place; all, each at the mean of its places,
    where fewer than two are constant. `sizes` (2, base): offsets in units of UNIT_OFFSET and errors of y (m).
    `settled_s` is when the speed of constant runs says where they belong.
    """

    found: Sequence[Excursion]
    settled_s: float
    places: Sequence[Array]
    base: npt.NDArray[np.intp]
    sizes: Array
    kinds: Kinds
    _base_places: Array = field(init=False, repr=False)  # (base, coordinate); scales need them often

    def __post_init__(self) -> None:
        object.__setattr__(self, "_base_places", np.stack([self.places[row].mean(axis=0) for row in self.base]))

    @classmethod
    def of(cls, runs: Sequence[ObservedRun], models: Mapping[str, OffsetModel]) -> Evidence:
        """From runs and, by name, a model that has not seen the run. Raises ValueError when one is missing."""
        found = excursions(runs, models)
        prior = models[runs[0].name].prior
        constant = [row for row, run in enumerate(runs) if not run.varies]
        settled = min(runs[row].horizon_s for row in constant or range(len(runs)))
        speeds = np.array([0.0 if each.run.varies else each.speed_at(settled) for each in found])
        there = [
            each.meeting.places(prior.rover, prior.regolith)
            if each.run.varies
            else scenario_places(prior.rover, prior.regolith, each.run.scenario, speed[None])
            for each, speed in zip(found, speeds, strict=True)
        ]
        base = np.array(constant if len(constant) > 1 else range(len(runs)), dtype=np.intp)
        typical = [max(found[row].typical_score(), _LEAST_SIZE) for row in base]
        heights = [max(float(found[row].y_error_m.max()), _LEAST_Y_M) for row in base]
        return cls(found, settled, there, base, np.array([typical, heights]), Kinds(_kinds(runs), speeds))

    def scale(self, without: Collection[int] = ()) -> Scale:
        """Of the base, but for some of the runs (rows of `found`)."""
        kept = ~np.isin(self.base, list(without))
        return Scale(self._base_places[kept], self.sizes[:, kept])

    def expected(self, rows: Collection[int] | None = None, without: Collection[int] = ()) -> Array:
        """What the other runs, but for some, lead one to expect of each run, (2, run)."""
        chosen = range(len(self.found)) if rows is None else rows
        each = [self.scale({row, *without}).at(self.places[row]).mean(axis=1) for row in chosen]
        return np.stack(each, axis=1) if each else np.empty((2, 0))

    def outcomes(self) -> tuple[npt.NDArray[np.intp], Borders]:
        """What each run did, and the borders of its model's outcomes."""
        borders = np.array([each.borders() for each in self.found]).T
        return np.array([each.true_class() for each in self.found]), Borders(*borders)

    def shares(self) -> Array:
        """The largest share of each run of the base in what is expected at each run, (run, base), itself left out."""
        whole = self.scale()
        found = np.empty((len(self.found), len(self.base)))
        for row, there in enumerate(self.places):
            squared = np.square(there[:, None] - whole.places).sum(axis=-1)
            squared[:, self.base == row] = np.inf
            found[row] = kernel(squared).max(axis=0)
        return found

    def touched(self, without: Collection[int], shares: Array) -> npt.NDArray[np.intp]:
        """Runs of which less is known without some others."""
        return np.flatnonzero((shares[:, np.isin(self.base, list(without))] > _COUNTS).any(axis=1))


def _kinds(runs: Sequence[ObservedRun]) -> npt.NDArray[np.intp]:
    def kind(run: ObservedRun) -> int:
        if run.varies:
            return DRIVE
        return COAST if run.slope_deg < 0 or run.torque_nm == 0 else UPHILL

    return np.array([kind(run) for run in runs], dtype=np.intp)
