"""A run that is read but not yet accepted: what the checks look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.datasets.alignment import NOTHING_SAID, Alignment
from service.datasets.findings import Code, Finding, reject, warn
from service.datasets.passport import Passport
from service.datasets.run_table import RunEntry

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Canonical columns, each float64 (time,), the file's line of each row (time,), scenario and passport.

    `said` is what a person said of how it was recorded; `shift_s` was taken from the time stamps of the file.
    """

    entry: RunEntry
    columns: Mapping[str, Array]
    lines: npt.NDArray[np.int64]
    passport: Passport
    said: Alignment = NOTHING_SAID
    shift_s: float = 0.0

    @property
    def time_s(self) -> Array:
        """Times (time,), s, as read: not yet known to increase."""
        return self.columns["time_s"]

    def acting(self, name: str) -> Array:
        """slope_deg or torque_nm at each row (time,): of the rows, else of the run's entry, which then has it."""
        return self.columns[name] if name in self.columns else np.full(len(self.time_s), getattr(self.entry, name))

    def reject(self, code: Code, message: str, *, at: int | None = None, column: str | None = None) -> Finding:
        """A rejection at row index `at` (reported as the file's own line)."""
        return reject(self.entry.file, code, message, row=self._line(at), column=column)

    def warn(self, code: Code, message: str, *, at: int | None = None, column: str | None = None) -> Finding:
        """A warning at row index `at`."""
        return warn(self.entry.file, code, message, row=self._line(at), column=column)

    def _line(self, at: int | None) -> int | None:
        return None if at is None else int(self.lines[at])
