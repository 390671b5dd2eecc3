"""Whatever an operator uploads - an archive, a table, one file of Chrono - as a dataset with reasons.

What a file is, is seen from its content; nothing that its sender says of it is relied on.
"""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath

import numpy as np

from service.datasets.alignment import NOTHING_SAID
from service.datasets.checks.validate import check_entries
from service.datasets.columns import canonical_name
from service.datasets.file_names import run_name, upload_name
from service.datasets.findings import Code, Finding, UnusableFileError, reject, told_too, warn
from service.datasets.given import Given
from service.datasets.intake import Intake, Progress, run_in
from service.datasets.parquet import read_parquet, unknown_columns
from service.datasets.passport import PASSPORT_FILE, Passport, parse_passport
from service.datasets.readers.column_map import ColumnMap
from service.datasets.readers.folder import passport_of, take_listed, unlisted_in
from service.datasets.readers.foreign import unsupported
from service.datasets.readers.foreign_parquet import ParquetTable, declares_our_format
from service.datasets.readers.long_table import (
    MAY_CHANGE,
    REQUIRED_LABELS,
    is_long,
    name_findings,
    read_long,
    take_runs,
)
from service.datasets.readers.sniff import HEAD_BYTES, Kind, kind_of
from service.datasets.readers.table import Samples, Table
from service.datasets.readers.text_table import parse_text
from service.datasets.report import ValidationReport, refused
from service.datasets.run import Dataset, Run
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import SCENARIO_LIMITS, RunEntry, parse_run_table, scenario_fault
from service.datasets.uploads.archive import unpack_archive
from service.datasets.uploads.only_table import only_table
from service.datasets.uploads.unpacking import Meter, unpack_stream
from service.datasets.uploads.upload_form import UploadForm, UploadLimits
from service.errors import NO_ROOM, DatasetError, InvalidValueError, StorageFullError

_OF_FILES = ("frame", "reference", "start")


def read_upload(
    path: Path,
    *,
    filename: str,
    workspace: Path,
    form: UploadForm,
    limits: UploadLimits | None = None,
    progress: Progress | None = None,
) -> tuple[Dataset, ValidationReport]:
    """Read and validate what was uploaded to `path`. A bad run is rejected with its reasons; the others are accepted.

    Taken are: a zip or tar with runs.csv and passport.json, possibly below one common folder; a Parquet file of
    ours, or one with named columns; a long table (scenario columns beside the samples); one file of Chrono, whose
    scenario the form tells. Any of them may be packed once more by gzip, bzip2 or xz. `workspace` is an empty folder
    for what is unpacked, to be removed by the caller. `filename` is only shown.

    Raises RejectedDatasetError with the report when nothing is usable (or, if the form is strict, anything is not),
    InvalidValueError for a column map of the form that is not allowed, StorageFullError when the disk is.
    """
    file = upload_name(filename)
    reader = _UploadReader(form, limits or UploadLimits(), workspace, progress)
    try:
        return reader.read(path, file)
    except UnusableFileError as error:
        raise refused(error.findings) from error
    except OSError as error:
        if error.errno in NO_ROOM:
            raise StorageFullError(f"{file} cannot be unpacked: {error.strerror}") from error
        raise DatasetError(f"{file} cannot be unpacked on this machine: {error.strerror or error}") from error


@dataclass(frozen=True, slots=True)
class _UploadReader:
    form: UploadForm
    limits: UploadLimits
    workspace: Path
    progress: Progress | None

    def read(self, path: Path, file: str) -> tuple[Dataset, ValidationReport]:
        """Unwrap, then read by kind."""
        meter = Meter(self.limits, path.stat().st_size, file)
        kind, _ = _sniff(path)
        if kind.is_compressed:
            unpacked = self.workspace / "content"
            unpack_stream(path, kind, unpacked, meter, file)
            path, (kind, _) = unpacked, _sniff(unpacked)
            if kind.is_compressed:
                message = f"holds {kind} data in turn; pack it once"
                raise UnusableFileError([reject(file, Code.NESTED_ARCHIVE, message)])
        if kind in {Kind.ZIP, Kind.TAR}:
            folder = self.workspace / "files"
            folder.mkdir()
            # an unpacked tar is counted anew: its members are what was counted already
            meter = Meter(self.limits, path.stat().st_size, file)
            noticed = unpack_archive(path, kind, folder, file=file, limits=self.limits, meter=meter)
            return self._folder(folder, file, noticed)
        return self._file(path, file)

    def _file(
        self, path: Path, file: str, stored: bytes | None = None, noticed: Sequence[Finding] = ()
    ) -> tuple[Dataset, ValidationReport]:
        """One file that is no archive; `stored` is a passport that came with it."""
        kind, head = _sniff(path)
        if kind is Kind.EMPTY:
            raise UnusableFileError([reject(file, Code.EMPTY_FILE, "has no bytes")])
        foreign = unsupported(head, file)
        if foreign is not None:
            raise UnusableFileError([foreign])
        if kind not in {Kind.PARQUET, Kind.TEXT}:
            raise UnusableFileError([reject(file, Code.NESTED_ARCHIVE, f"is a {kind} inside an archive")])
        if kind is Kind.PARQUET and declares_our_format(path, file=file, limits=self.limits):
            return self._ours(path, file, stored, noticed)
        size = path.stat().st_size
        if size > self.limits.file_bytes:
            message = f"has {size} bytes, allowed are at most {self.limits.file_bytes}"
            raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])
        try:
            table: Table = (
                ParquetTable(path, file) if kind is Kind.PARQUET
                else parse_text(path.read_bytes(), file=file, max_rows=self.limits.rows)
            )  # fmt: skip
        except UnusableFileError as error:
            raise told_too(error, noticed) from error
        return self._table(table, stored, noticed)

    def _folder(self, root: Path, file: str, noticed: Sequence[Finding]) -> tuple[Dataset, ValidationReport]:
        """What was in an archive: a folder with runs.csv, or a single table."""
        tables = sorted((each for each in root.rglob(RUN_TABLE) if each.is_file()), key=lambda each: len(each.parts))
        if len(tables) > 1 and len(tables[0].parts) == len(tables[1].parts):
            message = f"there are {len(tables)} of them; upload one dataset at a time"
            raise UnusableFileError([reject(RUN_TABLE, Code.RUN_TABLE, message)])
        if tables:
            return self._listed(root, tables[0].parent, file, noticed)
        stored = _only_passport(root)
        passport, _ = self._passport(stored)
        inner, others = only_table(root, passport, self._column_map(passport)[0])
        name = inner.relative_to(root).as_posix()
        kind, _ = _sniff(inner)
        if kind is Kind.GZIP:
            unpacked = self.workspace / "content-of-member"
            unpack_stream(inner, kind, unpacked, Meter(self.limits, inner.stat().st_size, name), name)
            inner = unpacked
        return self._file(inner, name, stored, [*noticed, *others])

    def _listed(
        self, root: Path, folder: Path, file: str, noticed: Sequence[Finding]
    ) -> tuple[Dataset, ValidationReport]:
        """A folder with runs.csv somewhere in an archive's `root`. A passport may also lie above it."""
        above = [folder, *(each for each in folder.parents if each.is_relative_to(root))]
        stored = next((each / PASSPORT_FILE for each in above if (each / PASSPORT_FILE).is_file()), None)
        passport, told = self._passport(stored.read_bytes() if stored else None)
        mapping, of_map = self._column_map(passport)
        given = Given(self.form.scenario(), self.form.set_name)
        try:
            table = parse_run_table((folder / RUN_TABLE).read_bytes(), given)
        except UnusableFileError as error:
            raise told_too(error, noticed) from error
        except DatasetError as error:
            raise UnusableFileError([reject(RUN_TABLE, Code.RUN_TABLE, str(error))]) from error
        elsewhere = [each for each in unlisted_in(root, [], folder.relative_to(root).as_posix())
                     if not (root / each.file).is_relative_to(folder) and root / each.file != stored]  # fmt: skip
        intake = Intake(passport, said=self.form.said(), max_rows=self.limits.rows)
        intake.findings += [*noticed, *told, *of_map, *elsewhere]
        offered = take_listed(
            intake,
            folder,
            passport,
            table,
            column_map=mapping,
            max_file_bytes=min(self.limits.file_bytes, 256 << 20),
            max_total_bytes=self.limits.total_bytes,
            progress=self.progress,
            given=given,
        )
        return intake.conclude(self._name(file), offered, strict=self.form.strict)

    def _ours(
        self, path: Path, file: str, stored: bytes | None, noticed: Sequence[Finding]
    ) -> tuple[Dataset, ValidationReport]:
        """A Parquet file that this service wrote; its columns have our names."""
        try:
            dataset = read_parquet(str(path))
        except DatasetError as error:
            raise UnusableFileError([reject(file, Code.BROKEN_PARQUET, str(error))]) from error
        passport, told = dataset.passport, list[Finding]()
        if self.form.passport is not None:
            passport, told = self._passport(dataset.passport.canonical_json().encode())
        elif stored is not None:
            told = [warn(PASSPORT_FILE, Code.PASSPORT, f"the passport within {file} is used, not this one")]
        if passport.alignment is not None:
            told.append(warn(PASSPORT_FILE, Code.IGNORED_FIELD, f"not used: {file} is aligned", column="alignment"))
            passport = passport.of_aligned(NOTHING_SAID)
        intake = Intake(passport, max_rows=self.limits.rows)
        entries = [(_entry_of(run, file), run) for run in dataset.runs]
        between = list(check_entries([entry for entry, _ in entries]))
        unused = self._unused((*SCENARIO_LIMITS, *_OF_FILES, "set_name", "column_map"), "the file says it")
        unknown = unknown_columns(str(path))
        if unknown:
            unused.append(warn(file, Code.IGNORED_COLUMN, f"not used: {', '.join(map(repr, unknown[:12]))}"))
        called = Counter(run_name(run.name)[0] for run in dataset.runs)
        names = [
            finding
            for entry, run in entries
            for finding in name_findings(run.name, entry.file, row=None, times=called[run_name(run.name)[0]])
        ]
        intake.findings += [*noticed, *told, *unused, *between, *names, *_scenario_faults(entries)]
        barred = {finding.file for finding in intake.findings if finding.rejects}
        for entry, run in entries:
            if entry.file not in barred and RUN_TABLE not in barred:
                intake.take(entry, run_name(run.name)[0], partial(_samples_of, run))
        name = self.form.name or self._name(dataset.name or file)
        return intake.conclude(name, [entry.file for entry, _ in entries], strict=self.form.strict)

    def _table(
        self, table: Table, stored: bytes | None, noticed: Sequence[Finding]
    ) -> tuple[Dataset, ValidationReport]:
        """A table of many runs, or of one whose scenario the form tells."""
        passport, told = self._passport(stored)
        mapping, of_map = self._column_map(passport)
        intake = Intake(passport, said=self.form.said(), max_rows=self.limits.rows)
        intake.findings += [*noticed, *told, *of_map]
        try:
            offered = self._offer(intake, table, passport, mapping)
        except UnusableFileError as error:
            raise told_too(error, intake.findings) from error
        return intake.conclude(self._name(table.file), offered, strict=self.form.strict)

    def _offer(self, intake: Intake, table: Table, passport: Passport, mapping: ColumnMap | None) -> list[str]:
        """Hand the runs of a table to `intake`. Returns what they are called."""
        given = self.form.scenario()
        if is_long(table.names):
            long = read_long(table, mapping, intake.said)
            said = [*long.numbers, *(["set_name"] if "set" in long.texts else [])]
            intake.findings += [*long.noticed, *self._unused(said, "the table has such a column")]
            return take_runs(intake, long, given=given, set_name=self.form.set_name)
        by_rows = {*(mapping.sources if mapping else ()), *map(canonical_name, passport.columns or ())}
        samples, entry = _both(
            partial(run_in, table, passport, mapping, intake.said),
            partial(_only_entry, table.file, given, self.form, by_rows),
        )
        intake.take(entry, _stem(table.file), lambda: samples)
        return [table.file]

    def _unused(self, fields: Collection[str], why: str) -> list[Finding]:
        """A word about each of these fields that the form has: what files say comes first."""
        given = {name: getattr(self.form, name) for name in fields}
        return [
            warn("form", Code.IGNORED_FIELD, f"{name} {value!r} is not used: {why}", column=name)
            for name, value in given.items()
            if value != UploadForm.model_fields[name].default
        ]

    def _passport(self, stored: bytes | None) -> tuple[Passport, list[Finding]]:
        """The form's, else the upload's, else the default, and what is to be said about that."""
        if self.form.passport is None and stored is None:
            return passport_of(None)
        data = stored or b""
        if self.form.passport is not None:
            try:
                data = json.dumps(self.form.passport, allow_nan=False).encode()
            except (ValueError, RecursionError) as error:
                raise UnusableFileError([reject(PASSPORT_FILE, Code.PASSPORT, f"is not JSON: {error}")]) from error
        try:
            passport = parse_passport(data)
        except DatasetError as error:
            raise UnusableFileError([reject(PASSPORT_FILE, Code.PASSPORT, str(error))]) from error
        if self.form.passport is None or stored is None:
            return passport, []
        return passport, [warn(PASSPORT_FILE, Code.PASSPORT, "the form's passport is used, not the one in the upload")]

    def _column_map(self, passport: Passport) -> tuple[ColumnMap | None, list[Finding]]:
        """The form's, else the passport's, and what is to be said about that."""
        if self.form.column_map is not None:
            message = "the form's column map is used, not the passport's"
            both = passport.column_map is not None
            told = [warn(PASSPORT_FILE, Code.IGNORED_FIELD, message, column="column_map")] if both else []
            return ColumnMap.of(self.form.column_map), told
        try:
            return ColumnMap.of(passport.column_map), []
        except InvalidValueError as error:
            raise UnusableFileError([reject(PASSPORT_FILE, Code.PASSPORT, str(error))]) from error

    def _name(self, file: str) -> str:
        """The form's name, else one made of the file's."""
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", _stem(file)).strip("-._")[:63]
        return self.form.name or plain or "upload"


def _sniff(path: Path) -> tuple[Kind, bytes]:
    with path.open("rb") as stream:
        head = stream.read(HEAD_BYTES)
    return kind_of(head), head


def _only_passport(root: Path) -> bytes | None:
    """The passport of an archive that has one. Two would have to be told apart by a runs.csv."""
    passports = [each for each in root.rglob(PASSPORT_FILE) if each.is_file()]
    if len(passports) > 1:
        message = f"there are {len(passports)} of them; put the one that holds beside the table"
        raise UnusableFileError([reject(PASSPORT_FILE, Code.PASSPORT, message)])
    return passports[0].read_bytes() if passports else None


def _stem(file: str) -> str:
    """The file's name without folders and the endings of formats."""
    name = PurePosixPath(file).name
    for ending in (".gz", ".bz2", ".xz", ".tgz", ".txz", ".tar", ".zip", ".csv", ".tsv", ".txt", ".dat", ".parquet"):
        name = name[: -len(ending)] if name.lower().endswith(ending) and len(name) > len(ending) else name
    return name or os.fspath(file)


def _only_entry(file: str, given: dict[str, float], form: UploadForm, by_rows: Collection[str | None]) -> RunEntry:
    """`by_rows` are columns that the file has without a header that says so."""
    missing = [name for name in REQUIRED_LABELS if name not in given and not (name in MAY_CHANGE and name in by_rows)]
    if missing:
        message = (
            "the file does not tell its scenario: give slope_deg, mass_kg and torque_nm as fields of the form, or as "
            "columns"
        )
        raise UnusableFileError([reject(file, Code.SCENARIO_MISSING, message, column=name) for name in missing])
    slope, torque, horizon = (given.get(name) for name in ("slope_deg", "torque_nm", "horizon_s"))
    return RunEntry(file, form.set_name, slope, given["mass_kg"], torque, horizon, None, 1)


def _entry_of(run: Run, file: str) -> RunEntry:
    slope, torque = (None if name in run.varies else getattr(run, name) for name in MAY_CHANGE)
    return RunEntry(f"{file}#{run.name}", run.set_name, slope, run.mass_kg, torque, run.horizon_s, None, 1)


def _both(read: Callable[[], Samples], enter: Callable[[], RunEntry]) -> tuple[Samples, RunEntry]:
    """What both give. Raises UnusableFileError with the reasons of both."""
    faults: list[Finding] = []
    try:
        samples = read()
    except UnusableFileError as error:
        faults += error.findings
    try:
        entry = enter()
    except UnusableFileError as error:
        faults += error.findings
    if faults:
        raise UnusableFileError(faults)
    return samples, entry


def _samples_of(run: Run) -> Samples:
    return Samples(run.columns, np.arange(1, len(run) + 1, dtype=np.int64))


def _scenario_faults(entries: list[tuple[RunEntry, Run]]) -> list[Finding]:
    scenarios = ((entry.file, zip(("slope_deg", "mass_kg", "torque_nm", "horizon_s"), run.scenario, strict=True))
                 for entry, run in entries)  # fmt: skip
    found = ((file, name, scenario_fault(name, value)) for file, values in scenarios for name, value in values)
    return [reject(file, *fault, column=name) for file, name, fault in found if fault is not None]
