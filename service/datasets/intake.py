"""From tables with their scenarios to a dataset: names resolved, runs checked, what is bad rejected with reasons."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from service.datasets.checks.candidate import Array, Candidate
from service.datasets.checks.validate import check_duplicates, check_run, check_slopes
from service.datasets.findings import Code, Finding, UnusableFileError, reject
from service.datasets.passport import Passport
from service.datasets.readers.chrono_text import TextTable
from service.datasets.readers.column_map import ColumnMap, resolve
from service.datasets.report import RejectedDatasetError, ValidationReport, make_report
from service.datasets.run import MAX_TOTAL_ROWS, Dataset, Run
from service.datasets.run_table import RunEntry
from service.datasets.summary import summarise

Progress = Callable[[int, int, str], None]
"""Called before each file with (files done, files in all, file)."""


class Intake:
    """Takes the tables of one dataset, one by one; `conclude` gives the dataset and the report."""

    def __init__(self, passport: Passport, column_map: ColumnMap | None, *, max_rows: int = MAX_TOTAL_ROWS) -> None:
        self._passport, self._column_map = passport, column_map
        self._max_rows = self._rows_left = max_rows
        self._runs: list[tuple[str, Run]] = []
        self.findings: list[Finding] = []

    def take(
        self, entry: RunEntry, name: str, read: Callable[[], TextTable], inputs: Mapping[str, Array] | None = None
    ) -> None:
        """One run: what `read` gives, as the run `name` of `entry`. Faults become findings.

        `inputs` are further columns, by canonical name, as many values as the table has rows.
        """
        try:
            candidate, noticed = self._candidate(entry, read(), inputs or {})
        except UnusableFileError as error:
            self.findings += error.findings
            return
        noticed = [*noticed, *check_run(candidate)]
        self.findings += noticed
        if not any(finding.rejects for finding in noticed):
            self._runs.append((entry.file, _run(candidate, name)))

    def conclude(self, name: str, offered: Iterable[str], *, strict: bool) -> tuple[Dataset, ValidationReport]:
        """The dataset of all accepted runs; `offered` are the files of all runs there should be.

        Raises RejectedDatasetError when no run is usable or, with `strict`, when any is not.
        """
        findings = [*self.findings, *check_duplicates(self._runs), *check_slopes(self._runs)]
        barred = {finding.file for finding in findings if finding.rejects}
        accepted = {file: run for file, run in self._runs if file not in barred}
        rejected = [file for file in dict.fromkeys(offered) if file not in accepted]
        dataset = Dataset(name, self._passport, tuple(accepted.values())) if accepted else None
        report = make_report(tuple(accepted), rejected, findings, summarise(dataset) if dataset else None)
        if dataset is None:
            raise RejectedDatasetError(report, "no run is usable")
        if strict and report.rejections:
            raise RejectedDatasetError(report, f"{len(report.rejections)} reasons to reject")
        return dataset, report

    def _candidate(
        self, entry: RunEntry, table: TextTable, inputs: Mapping[str, Array]
    ) -> tuple[Candidate, Sequence[Finding]]:
        self._rows_left -= len(table.lines)
        if self._rows_left < 0:
            message = f"the dataset has more than {self._max_rows} rows, allowed is at most {self._max_rows}"
            raise UnusableFileError([reject(entry.file, Code.TOO_LARGE, message)])
        names, declared = table.names, self._passport.columns
        if names is None and declared is not None and len(declared) == len(table.columns):
            names = declared
        found = resolve(names, len(table.columns), self._column_map, file=entry.file)
        columns = {name: table.columns[index] for name, index in found.indices.items()}
        if found.zero_start:
            columns = _from_zero(columns)
        columns |= inputs
        return Candidate(entry, columns, table.lines, self._passport), found.findings


def _run(candidate: Candidate, name: str) -> Run:
    entry = candidate.entry
    horizon_s = entry.horizon_s if entry.horizon_s is not None else round(float(candidate.time_s[-1]), 6)
    slope, torque = (_at_start(candidate, each) for each in ("slope_deg", "torque_nm"))
    return Run(name, entry.set_name, slope, entry.mass_kg, torque, horizon_s, candidate.columns)


def _at_start(candidate: Candidate, name: str) -> float:
    """What the run's entry says, else its first row: they agree (see `checks.values`)."""
    declared: float | None = getattr(candidate.entry, name)
    return float(candidate.columns[name][0]) if declared is None else declared


def _from_zero(columns: dict[str, Array]) -> dict[str, Array]:
    """Time and x counted from the first row. (A first row that is nan is left to validation.)"""
    shift = {"time_s": columns["time_s"][0], "rear_x_m": columns["rear_x_m"][0]}
    shift["front_x_m"] = shift["rear_x_m"]
    return {name: column - shift[name] if name in shift else column for name, column in columns.items()}
