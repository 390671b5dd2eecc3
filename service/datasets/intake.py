"""From samples with their scenarios to a dataset: runs checked, what is bad rejected with reasons."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from service.datasets.align import aligned
from service.datasets.alignment import FIRST_ROW, NOTHING_SAID, Alignment
from service.datasets.checks.candidate import Candidate
from service.datasets.checks.labels import check_labels
from service.datasets.checks.validate import (
    Fingerprint,
    check_duplicates,
    check_passport,
    check_run,
    check_slopes,
    fingerprint,
)
from service.datasets.findings import Code, Finding, UnusableFileError, reject, told_too, warn
from service.datasets.passport import PASSPORT_FILE, Passport
from service.datasets.readers.column_map import ColumnMap, resolve
from service.datasets.readers.headerless import with_suggestion
from service.datasets.readers.table import Samples, Table, numbers_if_any, samples_of
from service.datasets.report import RejectedDatasetError, ValidationReport, make_report
from service.datasets.run import MAX_ROWS_PER_RUN, MAX_TOTAL_ROWS, Dataset, Run
from service.datasets.run_table import RunEntry
from service.datasets.summary import RunSummary, summarise_run, summary_of

Progress = Callable[[int, int, str], None]
"""Called before each file with (files done, files in all, file)."""


@dataclass(frozen=True, slots=True)
class _Accepted:
    """A run that passed its own checks; `run` is None where only the report is wanted."""

    fingerprint: Fingerprint
    summary: RunSummary
    run: Run | None

    @property
    def file(self) -> str:
        return self.fingerprint.file


class Intake:
    """Takes the runs of one dataset, one by one; `report`, or `conclude`, ends it.

    With `keep` False the rows of a run are forgotten once it is checked, so that memory does not grow with their
    number: for a report without a dataset. `said` and the passport tell how runs were recorded; the dataset's passport
    is that of the runs as they are kept.
    """

    def __init__(
        self,
        passport: Passport,
        *,
        said: Alignment = NOTHING_SAID,
        max_rows: int = MAX_TOTAL_ROWS,
        keep: bool = True,
    ) -> None:
        self.said = said.over(passport.said)
        self._passport = passport.of_aligned(self.said)
        self._max_rows = self._rows_left = max_rows
        self._keep = keep
        self._runs: list[_Accepted] = []
        self.findings: list[Finding] = [*_conflicts(said, passport), *check_passport(self._passport)]

    def take(self, entry: RunEntry, name: str, read: Callable[[], Samples]) -> None:
        """One run: what `read` gives, as the run `name` of `entry`. Faults become findings."""
        try:
            samples = read()
            self._count(entry, len(samples.lines))
            of_start = Alignment(start=FIRST_ROW) if samples.zero_start else NOTHING_SAID
            moved = aligned(samples, entry, self._passport, self.said.over(of_start))
        except UnusableFileError as error:
            self.findings += error.findings
            return
        candidate = Candidate(moved.entry, moved.columns, moved.lines, self._passport, self.said, moved.shift_s)
        # where a preset was found, its finding says already that the first row is the start
        is_told = not self.said.words() and any(each.code is Code.PRESET for each in samples.findings)
        noticed = [*samples.findings, *(() if is_told else moved.findings), *check_run(candidate)]
        self.findings += noticed
        if not any(finding.rejects for finding in noticed):
            run = _run(candidate, name)
            kept = run if self._keep else None
            self._runs.append(_Accepted(fingerprint(entry.file, run), summarise_run(run), kept))

    def report(self, offered: Iterable[str], *, strict: bool) -> ValidationReport:
        """What was accepted and what was not; `offered` are the files of all runs there should be.

        Raises RejectedDatasetError when no run is usable or, with `strict`, when any is not.
        """
        return self._judged(offered, strict=strict)[1]

    def conclude(self, name: str, offered: Iterable[str], *, strict: bool) -> tuple[Dataset, ValidationReport]:
        """The dataset of all accepted runs, and the report. Raises RejectedDatasetError as `report` does."""
        accepted, report = self._judged(offered, strict=strict)
        return Dataset(name, self._passport, tuple(each.run for each in accepted if each.run is not None)), report

    def _judged(self, offered: Iterable[str], *, strict: bool) -> tuple[list[_Accepted], ValidationReport]:
        between = check_duplicates(each.fingerprint for each in self._runs)
        slopes = check_slopes((each.file, each.summary) for each in self._runs)
        findings = [*self.findings, *between, *slopes]
        barred = {finding.file for finding in findings if finding.rejects}
        accepted = [each for each in self._runs if each.file not in barred]
        files = {each.file: None for each in accepted}
        rejected = [file for file in dict.fromkeys(offered) if file not in files]
        summary = summary_of([each.summary for each in accepted]) if accepted else None
        report = make_report(tuple(files), rejected, findings, summary)
        if not accepted:
            raise RejectedDatasetError(report, "no run is usable")
        if strict and report.rejections:
            raise RejectedDatasetError(report, f"{len(report.rejections)} reasons to reject")
        return accepted, report

    def _count(self, entry: RunEntry, rows: int) -> None:
        self._rows_left -= rows
        if self._rows_left < 0:
            message = f"the dataset has more than {self._max_rows} rows, allowed is at most {self._max_rows}"
            raise UnusableFileError([reject(entry.file, Code.TOO_LARGE, message)])


def _conflicts(said: Alignment, passport: Passport) -> list[Finding]:
    """A word about what the passport says of the runs' recording and is not heeded."""
    theirs = passport.said.words()
    return [
        warn(PASSPORT_FILE, Code.IGNORED_FIELD, f"{name} {theirs[name]} is not used: {word} was asked for",
             column=f"alignment.{name}")
        for name, word in said.words().items()
        if name in theirs and theirs[name] != word
    ]  # fmt: skip


def run_in(table: Table, passport: Passport, column_map: ColumnMap | None, said: Alignment = NOTHING_SAID) -> Samples:
    """The samples of a table that holds one run; the passport names the columns of one without a header.

    Raises UnusableFileError.
    """
    if len(table.lines) > MAX_ROWS_PER_RUN:
        message = f"{len(table.lines)} rows in one run, allowed are at most {MAX_ROWS_PER_RUN}"
        raise UnusableFileError([reject(table.file, Code.TOO_LARGE, message)])
    noticed: tuple[Finding, ...] = ()
    names = names_of(table, passport)
    try:
        found = resolve(names, table.width, column_map, file=table.file, front=said.is_of_front)
        noticed = found.findings
        columns = dict(zip(found.indices, table.numbers(list(found.indices.values()), flags=found.flags), strict=True))
        samples = samples_of(columns, table.lines, file=table.file, zero_start=found.zero_start)
    except UnusableFileError as error:
        known = told_too(error, (*table.noticed, *noticed))
        if names is None and column_map is None:
            raise UnusableFileError(with_suggestion(table, known.findings)) from error
        raise known from error
    checked = {name: column.values for name, column in numbers_if_any(table, found.checked).items()}
    lies = check_labels(found.preset, columns["time_s"].values, checked, file=table.file)
    return replace(samples, findings=(*table.noticed, *found.findings, *lies, *samples.findings))


def names_of(table: Table, passport: Passport) -> tuple[str, ...] | None:
    """The names of a table's columns: its own, else those of the passport, if there are as many."""
    declared = passport.columns
    if table.names is None and declared is not None and len(declared) == table.width:
        return declared
    return table.names


def _run(candidate: Candidate, name: str) -> Run:
    entry = candidate.entry
    horizon_s = entry.horizon_s if entry.horizon_s is not None else round(float(candidate.time_s[-1]), 6)
    slope, torque = (_at_start(candidate, each) for each in ("slope_deg", "torque_nm"))
    return Run(name, entry.set_name, slope, entry.mass_kg, torque, horizon_s, candidate.columns)


def _at_start(candidate: Candidate, name: str) -> float:
    """What the run's entry says, else its first row: they agree (see `checks.values`)."""
    declared: float | None = getattr(candidate.entry, name)
    return float(candidate.columns[name][0]) if declared is None else declared
