"""A dataset as a folder: passport.json, runs.csv and the files that it lists."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path, PurePosixPath

from service.datasets.candidate import Array, Candidate
from service.datasets.chrono_text import read_text
from service.datasets.column_map import ColumnMap, resolve
from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject, warn
from service.datasets.passport import MAX_BYTES as PASSPORT_MAX_BYTES
from service.datasets.passport import Passport, parse_passport
from service.datasets.report import RejectedDatasetError, ValidationReport
from service.datasets.run import Dataset, Run
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import MAX_BYTES as TABLE_MAX_BYTES
from service.datasets.run_table import RunEntry, parse_run_table
from service.datasets.source import DEFAULT_MAX_BYTES
from service.datasets.summary import summarise
from service.datasets.validate import check_duplicates, check_entries, check_passport, check_run
from service.errors import DatasetError, InvalidValueError

PASSPORT = "passport.json"
MAX_TOTAL_ROWS = 20_000_000
Progress = Callable[[int, int, str], None]
"""Called before each file with (files done, files in all, file)."""


def read_folder(
    folder: str | os.PathLike[str],
    *,
    sets: Collection[str] | None = None,
    strict: bool = False,
    column_map: ColumnMap | str | Mapping[str, str | int] | None = None,
    name: str | None = None,
    max_file_bytes: int = DEFAULT_MAX_BYTES,
    progress: Progress | None = None,
) -> tuple[Dataset, ValidationReport]:
    """Read and validate. A bad run is left out with its reasons; the others are accepted.

    `column_map` (or the passport's own) says which column is which where headers do not. Raises DatasetError
    when passport or runs.csv cannot be used, RejectedDatasetError (with the report) when no run is usable or,
    with `strict`, when any is not; InvalidValueError for a set that runs.csv does not have.
    """
    root = Path(folder)
    passport = parse_passport(_read_small(root / PASSPORT, PASSPORT_MAX_BYTES))
    every, findings = parse_run_table(_read_small(root / RUN_TABLE, TABLE_MAX_BYTES))
    entries = _chosen(every, sets)
    listed_findings = [*findings, *check_passport(passport), *check_entries(entries), *_unlisted(root, every)]
    mapping = ColumnMap.of(column_map if column_map is not None else passport.column_map)
    reader = _Reader(root, passport, mapping, _names(every), max_file_bytes)
    runs, file_findings = reader.read(_unbarred(entries, listed_findings), progress)
    return _conclude(name or root.resolve().name, passport, entries, runs, [*listed_findings, *file_findings], strict)


def _conclude(
    name: str,
    passport: Passport,
    entries: list[RunEntry],
    runs: list[tuple[str, Run]],
    findings: list[Finding],
    strict: bool,
) -> tuple[Dataset, ValidationReport]:
    findings = [*findings, *check_duplicates(runs)]
    barred = {finding.file for finding in findings if finding.rejects}
    accepted = [(file, run) for file, run in runs if file not in barred]
    files = tuple(file for file, _ in accepted)
    rejected = tuple(dict.fromkeys(entry.file for entry in entries if entry.file not in files))
    dataset = Dataset(name, passport, tuple(run for _, run in accepted)) if accepted else None
    report = ValidationReport(files, rejected, tuple(findings), summarise(dataset) if dataset else None)
    if dataset is None:
        raise RejectedDatasetError(report, "no run is usable")
    if strict and report.rejections:
        raise RejectedDatasetError(report, f"{len(report.rejections)} reasons to reject")
    return dataset, report


class _Reader:
    """Reads the files of one folder, each into a run or into findings."""

    def __init__(
        self, root: Path, passport: Passport, mapping: ColumnMap | None, names: dict[str, str], max_bytes: int
    ) -> None:
        self._root, self._passport, self._mapping = root, passport, mapping
        self._names, self._max_bytes = names, max_bytes
        self._rows_left = MAX_TOTAL_ROWS

    def read(self, entries: list[RunEntry], progress: Progress | None) -> tuple[list[tuple[str, Run]], list[Finding]]:
        """Accepted runs with their files, and all findings."""
        runs: list[tuple[str, Run]] = []
        findings: list[Finding] = []
        for done, entry in enumerate(entries):
            if progress is not None:
                progress(done, len(entries), entry.file)
            try:
                candidate, noticed = self._candidate(entry)
            except UnusableFileError as error:
                findings += error.findings
                continue
            noticed = [*noticed, *check_run(candidate)]
            findings += noticed
            if not any(finding.rejects for finding in noticed):
                runs.append((entry.file, self._run(candidate)))
        return runs, findings

    def _candidate(self, entry: RunEntry) -> tuple[Candidate, list[Finding]]:
        with _inside(self._root, entry.file).open("rb") as stream:
            table = read_text(stream, file=entry.file, max_bytes=self._max_bytes)
        self._rows_left -= len(table.lines)
        if self._rows_left < 0:
            message = f"the dataset has more than {MAX_TOTAL_ROWS} rows, allowed is at most {MAX_TOTAL_ROWS}"
            raise UnusableFileError([reject(entry.file, Code.TOO_LARGE, message)])
        names, declared = table.names, self._passport.columns
        if names is None and declared is not None and len(declared) == len(table.columns):
            names = declared
        found = resolve(names, len(table.columns), self._mapping, file=entry.file)
        columns = {name: table.columns[index] for name, index in found.indices.items()}
        if found.zero_start:
            columns = _from_zero(columns)
        return Candidate(entry, columns, table.lines, self._passport), list(found.findings)

    def _run(self, candidate: Candidate) -> Run:
        entry = candidate.entry
        horizon_s = entry.horizon_s if entry.horizon_s is not None else round(float(candidate.time_s[-1]), 6)
        return Run(
            self._names[entry.file],
            entry.set_name,
            entry.slope_deg,
            entry.mass_kg,
            entry.torque_nm,
            horizon_s,
            candidate.columns,
        )


def _from_zero(columns: dict[str, Array]) -> dict[str, Array]:
    """Time and x counted from the first row. (A first row that is nan is left to validation.)"""
    shift = {"time_s": columns["time_s"][0], "rear_x_m": columns["rear_x_m"][0]}
    shift["front_x_m"] = shift["rear_x_m"]
    return {name: column - shift[name] if name in shift else column for name, column in columns.items()}


def _read_small(path: Path, max_bytes: int) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(max_bytes + 1)
    except OSError as error:
        raise DatasetError(f"{path.name} cannot be read in the dataset's folder: {error.strerror}") from error


def _chosen(entries: list[RunEntry], sets: Collection[str] | None) -> list[RunEntry]:
    if sets is None:
        return entries
    known = dict.fromkeys(entry.set_name for entry in entries)
    absent = sorted(set(sets) - set(known))
    if absent:
        raise InvalidValueError("sets", absent, f"sets of {RUN_TABLE}: {', '.join(known)}")
    return [entry for entry in entries if entry.set_name in sets]


def _unbarred(entries: list[RunEntry], findings: list[Finding]) -> list[RunEntry]:
    """Entries whose line of runs.csv is not rejected; a rejection without a line bars them all."""
    rows = {finding.row for finding in findings if finding.file == RUN_TABLE and finding.rejects}
    wrong_as_a_whole = None in rows
    return [] if wrong_as_a_whole else [entry for entry in entries if entry.line not in rows]


def _names(entries: list[RunEntry]) -> dict[str, str]:
    """Run names: files without their endings, and without the folder that all of them share."""
    files = list(dict.fromkeys(entry.file for entry in entries))
    parents = [str(PurePosixPath(file).parent) for file in files]
    shared = os.path.commonpath(parents) if parents else "."
    short = {file: str(PurePosixPath(file).relative_to(shared)) for file in files}
    stems = {file: _without_endings(text) for file, text in short.items()}
    unique = len(set(stems.values())) == len(stems)
    return stems if unique else short


def _without_endings(text: str) -> str:
    for ending in (".gz", ".csv", ".txt", ".dat"):
        text = text.removesuffix(ending)
    return text


def _inside(root: Path, file: str) -> Path:
    """The file, once links are followed, is a regular file inside the folder. Raises UnusableFileError."""
    path = (root / file).resolve()
    if not path.is_relative_to(root.resolve()):
        message = "leads out of the dataset's folder; put the file itself inside"
        raise UnusableFileError([reject(file, Code.UNSAFE_PATH, message)])
    if not path.is_file():
        raise UnusableFileError([reject(file, Code.MISSING_FILE, f"listed in {RUN_TABLE} but not in the folder")])
    return path


def _unlisted(root: Path, entries: list[RunEntry]) -> Iterator[Finding]:
    """Data files that runs.csv does not mention: forgotten runs, most likely."""
    listed = {PurePosixPath(entry.file).as_posix() for entry in entries}
    found = 0
    for directory, _, files in os.walk(root):
        for file in sorted(files):
            name = (Path(directory) / file).relative_to(root).as_posix()
            if name in listed or not name.removesuffix(".gz").endswith((".csv", ".txt", ".dat")):
                continue
            if name != RUN_TABLE:
                found += 1
                if found > MAX_LOCATED:
                    return
                yield warn(name, Code.UNLISTED_FILE, f"not listed in {RUN_TABLE}, so not read")
