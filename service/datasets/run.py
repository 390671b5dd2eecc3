"""A run (one Chrono simulation) and a dataset (runs and the passport they share), as values."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from service.datasets.columns import BY_NAME, COLUMNS, INPUTS, REQUIRED
from service.datasets.passport import Passport
from service.errors import InvalidValueError

Array = npt.NDArray[np.float64]

# What a dataset may have, wherever it is read from.
MAX_RUNS = 10_000
MAX_ROWS_PER_RUN = 2_000_000
MAX_TOTAL_ROWS = 25_000_000  # a thousand runs of ten seconds at Chrono's 0.5 ms, and some


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One simulation: its scenario, in borders' units, and its columns, each float64 (time,), read-only.

    Columns have canonical names and units (see `columns`) and stand in canonical order; time_s, rear_x_m and
    rear_y_m are always there. `slope_deg`, `torque_nm` and `brake` are there only if they change (`brake`: if it is
    ever on): the scenario's slope and torque are then those of the first row, and `varies` names the columns. A
    column that does not change, at its stored digits, is dropped, since the scenario says the same.

    Raises InvalidValueError for unknown or missing columns, different lengths, values that are not finite, times that
    do not increase, and a slope or torque that is not the one of the first row.
    """

    name: str
    set_name: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    columns: Mapping[str, Array]

    def __post_init__(self) -> None:
        unknown = [name for name in self.columns if name not in BY_NAME]
        missing = [name for name in REQUIRED if name not in self.columns]
        if unknown or missing:
            allowed = f"{', '.join(REQUIRED)} and any of {', '.join(BY_NAME)}"
            raise InvalidValueError(f"columns of run {self.name}", list(self.columns), allowed)
        if not np.isfinite(self.scenario).all():
            raise InvalidValueError(f"scenario of run {self.name}", self.scenario, "finite numbers")
        kept = {c.name: self._column(c.name) for c in COLUMNS if c.name in self.columns}
        kept = {name: column for name, column in kept.items() if name not in INPUTS or self._changes(name, column)}
        object.__setattr__(self, "columns", MappingProxyType(kept))
        if not (np.diff(self.time_s) > 0).all():
            raise InvalidValueError(f"time_s of run {self.name}", "not increasing", "strictly increasing times")

    def _column(self, name: str) -> Array:
        # a view, so that the caller's own array stays writable
        column = np.asarray(self.columns[name], dtype=np.float64).view()
        rows = np.shape(self.columns["time_s"])
        if column.ndim != 1 or column.shape != rows or len(column) < 1:
            raise InvalidValueError(f"{name} of run {self.name}", column.shape, f"one value per time, {rows}")
        if not np.isfinite(column).all():
            raise InvalidValueError(f"{name} of run {self.name}", "nan or inf", "finite numbers")
        column.flags.writeable = False
        return column

    def _changes(self, name: str, column: Array) -> bool:
        """Whether an input says more than the scenario does."""
        start = 0.0 if name == "brake" else float(getattr(self, name))
        stored = np.rint(column * BY_NAME[name].scale)
        if name != "brake" and abs(stored[0] - start * BY_NAME[name].scale) > 1.0:
            raise InvalidValueError(f"{name} of run {self.name}", start, f"that of its first row, {column[0]:g}")
        return bool((stored != (0.0 if name == "brake" else stored[0])).any())

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def time_s(self) -> Array:
        """Times (time,), s, strictly increasing."""
        return self.columns["time_s"]

    @property
    def x_m(self) -> Array:
        """Rear wheel centre along the slope (time,), m."""
        return self.columns["rear_x_m"]

    @property
    def y_m(self) -> Array:
        """Rear wheel centre above the undeformed surface (time,), m."""
        return self.columns["rear_y_m"]

    @property
    def scenario(self) -> tuple[float, float, float, float]:
        """(slope_deg, mass_kg, torque_nm, horizon_s)."""
        return self.slope_deg, self.mass_kg, self.torque_nm, self.horizon_s

    @property
    def varies(self) -> tuple[str, ...]:
        """Which of slope_deg, torque_nm and brake change within the run."""
        return tuple(name for name in INPUTS if name in self.columns)

    def acting(self, name: str) -> Array:
        """slope_deg, torque_nm or brake at each row (time,), whether it changes or not."""
        constant = 0.0 if name == "brake" else float(getattr(self, name))
        return self.columns[name] if name in self.columns else np.full(len(self), constant)

    def rows(self, selection: npt.NDArray[np.intp]) -> Run:
        """The same run with only the selected rows, which include the first."""
        return replace(self, columns={name: column[selection] for name, column in self.columns.items()})


@dataclass(frozen=True, slots=True, eq=False)
class Dataset:
    """Runs with unique names and their passport. Raises InvalidValueError for no runs or repeated names."""

    name: str
    passport: Passport
    runs: tuple[Run, ...]

    def __post_init__(self) -> None:
        if not self.runs:
            raise InvalidValueError("runs", 0, "at least one run in a dataset")
        names = [run.name for run in self.runs]
        repeated = {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else None
        if repeated:
            raise InvalidValueError("run names", sorted(repeated)[:5], "unique names")

    @property
    def sets(self) -> tuple[str, ...]:
        """Names of the sets, in order of first appearance."""
        return tuple(dict.fromkeys(run.set_name for run in self.runs))

    def only_sets(self, sets: Collection[str]) -> Dataset:
        """The runs of these sets. Raises InvalidValueError when a set is not there."""
        absent = sorted(set(sets) - set(self.sets))
        if absent:
            raise InvalidValueError("sets", absent, f"sets of dataset {self.name}: {', '.join(self.sets)}")
        return replace(self, runs=tuple(run for run in self.runs if run.set_name in sets))
