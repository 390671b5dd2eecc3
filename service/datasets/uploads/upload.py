"""Whatever an operator uploads - an archive, a table, one file of Chrono - as a dataset with reasons.

What a file is, is seen from its content; nothing that its sender says of it is relied on.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath

import numpy as np

from service.datasets.checks.validate import check_entries, check_passport
from service.datasets.columns import canonical_name
from service.datasets.default_passport import VIPER_ON_LUNAR_REGOLITH
from service.datasets.file_names import upload_name
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.intake import Intake, Progress
from service.datasets.parquet import read_parquet
from service.datasets.passport import PASSPORT_FILE, Passport, parse_passport
from service.datasets.readers.chrono_text import TextTable, header_names, parse_text, split_text
from service.datasets.readers.column_map import ColumnMap, resolve
from service.datasets.readers.folder import read_listed
from service.datasets.readers.foreign_parquet import declares_our_format, read_foreign_parquet
from service.datasets.readers.long_table import MAY_CHANGE, REQUIRED_LABELS, LongTable, is_long, take_runs
from service.datasets.readers.long_text import parse_long_text, row_width
from service.datasets.readers.sniff import HEAD_BYTES, Kind, foreign_name, kind_of
from service.datasets.report import ValidationReport, refused
from service.datasets.run import Dataset, Run
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import RunEntry, parse_run_table, scenario_fault
from service.datasets.uploads.archive import unpack_archive
from service.datasets.uploads.unpacking import Meter, unpack_stream
from service.datasets.uploads.upload_form import UploadForm, UploadLimits
from service.errors import NO_ROOM, DatasetError, InvalidValueError, StorageFullError

_DATA_ENDINGS = (".csv", ".txt", ".dat", ".tsv", ".parquet", ".gz")


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
        kind, head = _sniff(path)
        if kind.is_compressed:
            unpacked = self.workspace / "content"
            unpack_stream(path, kind, unpacked, meter, file)
            path, (kind, head) = unpacked, _sniff(unpacked)
            if kind.is_compressed:
                message = f"holds {kind} data in turn; pack it once"
                raise UnusableFileError([reject(file, Code.NESTED_ARCHIVE, message)])
        if kind in {Kind.ZIP, Kind.TAR}:
            folder = self.workspace / "files"
            folder.mkdir()
            # an unpacked tar is counted anew: its members are what was counted already
            meter = Meter(self.limits, path.stat().st_size, file)
            unpack_archive(path, kind, folder, file=file, limits=self.limits, meter=meter)
            return self._folder(folder, file)
        return self._file(path, kind, head, file)

    def _file(self, path: Path, kind: Kind, head: bytes, file: str) -> tuple[Dataset, ValidationReport]:
        """One file that is no archive."""
        if kind is Kind.EMPTY:
            raise UnusableFileError([reject(file, Code.EMPTY_FILE, "has no bytes")])
        if kind is Kind.FOREIGN:
            message = (
                f"is {foreign_name(head)}; expected a zip or tar with runs.csv and passport.json, Parquet, or text "
                "with one row per sample"
            )
            raise UnusableFileError([reject(file, Code.UNSUPPORTED_FORMAT, message)])
        if kind is Kind.PARQUET:
            return self._parquet(path, file)
        if kind is not Kind.TEXT:
            raise UnusableFileError([reject(file, Code.NESTED_ARCHIVE, f"is a {kind} inside an archive")])
        return self._text(path, file)

    def _folder(self, root: Path, file: str) -> tuple[Dataset, ValidationReport]:
        """What was in an archive: a folder with runs.csv, or a single file."""
        tables = sorted((each for each in root.rglob(RUN_TABLE) if each.is_file()), key=lambda each: len(each.parts))
        if len(tables) > 1 and len(tables[0].parts) == len(tables[1].parts):
            message = f"there are {len(tables)} of them; upload one dataset at a time"
            raise UnusableFileError([reject(RUN_TABLE, Code.RUN_TABLE, message)])
        if tables:
            return self._listed(tables[0].parent, file)
        files = [each for each in root.rglob("*") if each.is_file() and each.name != PASSPORT_FILE]
        data = [each for each in files if each.name.lower().endswith(_DATA_ENDINGS)]
        if len(data) != 1:
            message = (
                f"is not in the archive, which has {len(files)} other files; it must list file, slope, mass, torque"
            )
            raise UnusableFileError([reject(RUN_TABLE, Code.MISSING_FILE, message)])
        inner, name = data[0], data[0].relative_to(root).as_posix()
        kind, head = _sniff(inner)
        if kind is Kind.GZIP:
            unpacked = self.workspace / "content-of-member"
            unpack_stream(inner, kind, unpacked, Meter(self.limits, inner.stat().st_size, name), name)
            inner, (kind, head) = unpacked, _sniff(unpacked)
        return self._file(inner, kind, head, name)

    def _listed(self, root: Path, file: str) -> tuple[Dataset, ValidationReport]:
        """A folder with runs.csv."""
        stored = root / PASSPORT_FILE
        passport, noticed = self._passport(stored.read_bytes() if stored.is_file() else None)
        try:
            table = parse_run_table((root / RUN_TABLE).read_bytes())
        except DatasetError as error:
            raise UnusableFileError([reject(RUN_TABLE, Code.RUN_TABLE, str(error))]) from error
        return read_listed(
            root,
            passport,
            table,
            name=self._name(file),
            column_map=self._column_map(passport),
            strict=self.form.strict,
            max_file_bytes=min(self.limits.file_bytes, 256 << 20),
            max_total_bytes=self.limits.total_bytes,
            max_rows=self.limits.rows,
            progress=self.progress,
            noticed=noticed,
        )

    def _parquet(self, path: Path, file: str) -> tuple[Dataset, ValidationReport]:
        if not declares_our_format(path, file=file, limits=self.limits):
            passport, noticed = self._passport(None)
            mapping = self._column_map(passport)
            long, findings = read_foreign_parquet(path, mapping, file=file)
            return self._table(long, passport, mapping, [*noticed, *findings], file)
        try:
            dataset = read_parquet(str(path))
        except DatasetError as error:
            raise UnusableFileError([reject(file, Code.BROKEN_PARQUET, str(error))]) from error
        passport, noticed = dataset.passport, list[Finding]()
        if self.form.passport is not None:
            passport, noticed = self._passport(dataset.passport.canonical_json().encode())
        # its columns have our names, whatever files a column map of the passport is about
        intake = Intake(passport, ColumnMap.of("rover-twin"), max_rows=self.limits.rows)
        entries = [(_entry_of(run, file), run) for run in dataset.runs]
        between = list(check_entries([entry for entry, _ in entries]))
        intake.findings += [*noticed, *check_passport(passport), *between, *_scenario_faults(entries)]
        barred = {finding.file for finding in intake.findings if finding.rejects}
        for entry, run in entries:
            if entry.file not in barred and RUN_TABLE not in barred:
                intake.take(entry, run.name, partial(_table_of, run))
        name = self.form.name or self._name(dataset.name or file)
        return intake.conclude(name, [entry.file for entry, _ in entries], strict=self.form.strict)

    def _text(self, path: Path, file: str) -> tuple[Dataset, ValidationReport]:
        size = path.stat().st_size
        if size > self.limits.file_bytes:
            message = f"has {size} bytes, allowed are at most {self.limits.file_bytes}"
            raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])
        passport, noticed = self._passport(None)
        mapping = self._column_map(passport)
        data = path.read_bytes()
        text = split_text(data, file=file, max_rows=self.limits.rows)
        names = header_names(text, row_width(text), file=file)
        if names is not None and is_long(names):
            del data
            return self._table(parse_long_text(text, names, file=file), passport, mapping, noticed, file)
        del text
        return self._table(LongTable(parse_text(data, file=file), {}, {}), passport, mapping, noticed, file)

    def _table(
        self, long: LongTable, passport: Passport, mapping: ColumnMap | None, noticed: list[Finding], file: str
    ) -> tuple[Dataset, ValidationReport]:
        """A table of many runs, or of one whose scenario the form tells."""
        intake = Intake(passport, mapping, max_rows=self.limits.rows)
        intake.findings += [*noticed, *check_passport(passport)]
        table = long.table
        given = self.form.scenario()
        if long.numbers or long.texts:
            found = resolve(table.names, len(table.columns), mapping, file=file)
            offered = take_runs(
                intake,
                long,
                table.columns[found.indices["time_s"]],
                file=file,
                given=given,
                set_name=self.form.set_name,
                zero_start=found.zero_start,
            )
        else:
            by_rows = {*(mapping.sources if mapping else ()), *map(canonical_name, passport.columns or ())}
            entry = _only_entry(file, given, self.form, by_rows)
            intake.take(entry, _stem(file), lambda: table)
            offered = [file]
        return intake.conclude(self._name(file), offered, strict=self.form.strict)

    def _passport(self, stored: bytes | None) -> tuple[Passport, list[Finding]]:
        """The form's, else the upload's, else the default, and what is to be said about that."""
        if self.form.passport is None and stored is None:
            message = (
                "no passport given: VIPER on lunar regolith is assumed (gravity 1.62 m/s2, wheel radius 0.25 m); "
                "give the field passport if anything else was simulated"
            )
            return VIPER_ON_LUNAR_REGOLITH, [warn(PASSPORT_FILE, Code.DEFAULT_PASSPORT, message)]
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

    def _column_map(self, passport: Passport) -> ColumnMap | None:
        if self.form.column_map is not None:
            return ColumnMap.of(self.form.column_map)
        try:
            return ColumnMap.of(passport.column_map)
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


def _table_of(run: Run) -> TextTable:
    lines = np.arange(1, len(run) + 1, dtype=np.int64)
    return TextTable(tuple(run.columns), tuple(run.columns.values()), lines)


def _scenario_faults(entries: list[tuple[RunEntry, Run]]) -> list[Finding]:
    scenarios = ((entry.file, zip(("slope_deg", "mass_kg", "torque_nm", "horizon_s"), run.scenario, strict=True))
                 for entry, run in entries)  # fmt: skip
    found = ((file, name, scenario_fault(name, value)) for file, values in scenarios for name, value in values)
    return [reject(file, *fault, column=name) for file, name, fault in found if fault is not None]
