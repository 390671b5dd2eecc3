"""Many scenarios in columns: a thousand objects would take longer to make than their positions in JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self, overload

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array, Scenarios
from service.twin.scenario import SHORTEST_S, Scenario


@dataclass(frozen=True, slots=True, eq=False)
class ManyScenarios(Sequence[Scenario]):
    """Slopes (deg), masses (kg), torques (N m) and horizons (s), each (scenario,): values that `Scenario` takes.

    Raises InvalidValueError for the first scenario that cannot be.
    """

    slope_deg: Array
    mass_kg: Array
    torque_nm: Array
    horizon_s: Array

    def __post_init__(self) -> None:
        fits = (np.abs(self.slope_deg) < 90.0) & (self.mass_kg > 0.0) & (self.torque_nm >= 0.0)
        fits &= np.isfinite(self.mass_kg) & np.isfinite(self.torque_nm) & np.isfinite(self.horizon_s)
        fits &= self.horizon_s > SHORTEST_S
        if not fits.all():
            self[int(fits.argmin())]

    @classmethod
    def of(cls, scenarios: Sequence[Scenario]) -> Self:
        """Any scenarios."""
        if isinstance(scenarios, cls):
            return scenarios
        rows = [(each.slope_deg, each.mass_kg, each.torque_nm, each.horizon_s) for each in scenarios]
        return cls(*np.array(rows, dtype=np.float64).reshape(-1, 4).T.copy())

    def __len__(self) -> int:
        return len(self.slope_deg)

    @overload
    def __getitem__(self, row: int) -> Scenario: ...

    @overload
    def __getitem__(self, row: slice) -> ManyScenarios: ...

    def __getitem__(self, row: int | slice) -> Scenario | ManyScenarios:
        if isinstance(row, slice):
            return ManyScenarios(*(column[row] for column in self._columns()))
        return Scenario(*(float(column[row]) for column in self._columns()))

    def only(self, rows: npt.NDArray[np.intp]) -> ManyScenarios:
        """Some of them; the arrays are copies."""
        return ManyScenarios(*(column[rows] for column in self._columns()))

    def as_physics(self) -> Scenarios:
        """The same in SI units and radians."""
        return Scenarios(np.radians(self.slope_deg), self.mass_kg, self.torque_nm)

    def _columns(self) -> tuple[Array, Array, Array, Array]:
        return self.slope_deg, self.mass_kg, self.torque_nm, self.horizon_s
