"""A dataset as a folder: passport.json, runs.csv and the files that it lists."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath

from service.datasets.checks.validate import check_entries, check_passport
from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject, warn
from service.datasets.intake import Intake, Progress
from service.datasets.passport import MAX_BYTES as PASSPORT_MAX_BYTES
from service.datasets.passport import PASSPORT_FILE, Passport, parse_passport
from service.datasets.readers.chrono_text import TextTable, parse_text
from service.datasets.readers.column_map import ColumnMap
from service.datasets.readers.source import DEFAULT_MAX_BYTES, read_bounded
from service.datasets.report import ValidationReport
from service.datasets.run import MAX_TOTAL_ROWS, Dataset
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import MAX_BYTES as TABLE_MAX_BYTES
from service.datasets.run_table import RunEntry, parse_run_table
from service.errors import DatasetError, InvalidValueError


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
    """Read and validate. A bad run is rejected with its reasons; the others are accepted.

    `column_map` (or the passport's own) says which column is which where headers do not. Raises DatasetError
    when passport or runs.csv cannot be used, RejectedDatasetError (with the report) when no run is usable or,
    with `strict`, when any is not; InvalidValueError for a set that runs.csv does not have.
    """
    root = Path(folder)
    passport = parse_passport(_read_small(root / PASSPORT_FILE, PASSPORT_MAX_BYTES))
    table = parse_run_table(_read_small(root / RUN_TABLE, TABLE_MAX_BYTES))
    return read_listed(
        root,
        passport,
        table,
        sets=sets,
        strict=strict,
        column_map=ColumnMap.of(column_map if column_map is not None else passport.column_map),
        name=name or root.resolve().name,
        max_file_bytes=max_file_bytes,
        progress=progress,
    )


def read_listed(
    root: Path,
    passport: Passport,
    table: tuple[list[RunEntry], list[Finding]],
    *,
    name: str,
    column_map: ColumnMap | None = None,
    sets: Collection[str] | None = None,
    strict: bool = False,
    max_file_bytes: int = DEFAULT_MAX_BYTES,
    max_total_bytes: int | None = None,
    max_rows: int = MAX_TOTAL_ROWS,
    progress: Progress | None = None,
    noticed: Sequence[Finding] = (),
) -> tuple[Dataset, ValidationReport]:
    """`read_folder` once passport and run table are parsed. `max_total_bytes` bounds all files together, unpacked;
    `noticed` is what is to stand in the report before all else.
    """
    every, findings = table
    entries = _chosen(every, sets)
    intake = Intake(passport, column_map, max_rows=max_rows)
    listed_findings = [*findings, *check_passport(passport), *check_entries(entries), *_unlisted(root, every)]
    intake.findings += [*noticed, *listed_findings]
    reader = _FileReader(root, max_file_bytes, max_total_bytes)
    names = _names(every)
    chosen = _unbarred(entries, listed_findings)
    for done, entry in enumerate(chosen):
        if progress is not None:
            progress(done, len(chosen), entry.file)
        intake.take(entry, names[entry.file], partial(reader.read, entry.file))
    return intake.conclude(name, [entry.file for entry in entries], strict=strict)


class _FileReader:
    """Reads the files of one folder within a bound on all of them."""

    def __init__(self, root: Path, max_file_bytes: int, max_total_bytes: int | None) -> None:
        self._root, self._max_file_bytes, self._bytes_left = root, max_file_bytes, max_total_bytes

    def read(self, file: str) -> TextTable:
        left = self._bytes_left
        most = self._max_file_bytes if left is None else max(0, min(self._max_file_bytes, left))
        path = _inside(self._root, file)
        if left is not None:
            # all of it is spent until the file turns out smaller: a bomb uses what it may, and is refused then
            self._bytes_left = left - most
        with path.open("rb") as stream:
            data = read_bounded(stream, file=file, max_bytes=most)
        if left is not None:
            self._bytes_left = left - len(data)
        return parse_text(data, file=file)


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
