"""A dataset as a folder: passport.json, runs.csv and the files that it lists."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath

from service.datasets.alignment import NOTHING_SAID, Alignment
from service.datasets.checks.validate import check_entries
from service.datasets.default_passport import VIPER_ON_LUNAR_REGOLITH
from service.datasets.file_names import is_of_desktop
from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject, warn
from service.datasets.given import Given
from service.datasets.intake import Intake, Progress, run_in
from service.datasets.passport import MAX_BYTES as PASSPORT_MAX_BYTES
from service.datasets.passport import PASSPORT_FILE, Passport, parse_passport
from service.datasets.readers.column_map import ColumnMap
from service.datasets.readers.foreign_parquet import ParquetTable, declares_our_format
from service.datasets.readers.sniff import HEAD_BYTES, Kind, kind_of
from service.datasets.readers.source import DEFAULT_MAX_BYTES, read_bounded
from service.datasets.readers.table import Samples, Table
from service.datasets.readers.text_preamble import COMMENTS
from service.datasets.readers.text_table import parse_text
from service.datasets.report import ValidationReport
from service.datasets.run import MAX_ROWS_PER_RUN, Dataset
from service.datasets.run_table import FILE as RUN_TABLE
from service.datasets.run_table import MAX_BYTES as TABLE_MAX_BYTES
from service.datasets.run_table import RunEntry, as_listed, parse_run_table, unsafe_path
from service.datasets.uploads.upload_form import UploadLimits
from service.errors import DatasetError, InvalidValueError

_NO_RUNS = {
    *(".md", ".rst", ".pdf", ".html", ".json", ".yaml", ".yml", ".toml", ".ini", ".sh", ".bat", ".ps1", ".py"),
    *(".ipynb", ".m", ".r", ".c", ".h", ".cpp", ".png", ".jpg", ".jpeg", ".svg", ".gif", ".mp4"),
}  # fmt: skip


def read_folder(
    folder: str | os.PathLike[str],
    *,
    sets: Collection[str] | None = None,
    strict: bool = False,
    column_map: ColumnMap | str | Mapping[str, str | int] | None = None,
    said: Alignment = NOTHING_SAID,
    name: str | None = None,
    max_file_bytes: int = DEFAULT_MAX_BYTES,
    progress: Progress | None = None,
) -> tuple[Dataset, ValidationReport]:
    """Read and validate. A bad run is rejected with its reasons; the others are accepted.

    `column_map` (or the passport's own) says which column is which where headers do not, and `said` (or the passport's
    `alignment`) how the runs were recorded. Raises DatasetError when passport or runs.csv cannot be used,
    RejectedDatasetError (with the report) when no run is usable or, with `strict`, when any is not; InvalidValueError
    for a set that runs.csv does not have.
    """
    root = Path(folder)
    intake, offered = _taken(root, sets, column_map, said, max_file_bytes, progress, keep=True)
    return intake.conclude(name or root.resolve().name, offered, strict=strict)


def validate_folder(
    folder: str | os.PathLike[str],
    *,
    sets: Collection[str] | None = None,
    strict: bool = False,
    column_map: ColumnMap | str | Mapping[str, str | int] | None = None,
    said: Alignment = NOTHING_SAID,
    max_file_bytes: int = DEFAULT_MAX_BYTES,
    progress: Progress | None = None,
    given: Given | None = None,
) -> ValidationReport:
    """The report of `read_folder` without the dataset: memory is that of the largest file. Raises as it does.

    `given` says what neither runs.csv nor the rows do, as the form of an upload.
    """
    intake, offered = _taken(Path(folder), sets, column_map, said, max_file_bytes, progress, keep=False, given=given)
    return intake.report(offered, strict=strict)


def _taken(
    root: Path,
    sets: Collection[str] | None,
    column_map: ColumnMap | str | Mapping[str, str | int] | None,
    said: Alignment,
    max_file_bytes: int,
    progress: Progress | None,
    *,
    keep: bool,
    given: Given | None = None,
) -> tuple[Intake, list[str]]:
    passport, noticed = passport_of(_read_small(root / PASSPORT_FILE, PASSPORT_MAX_BYTES, needed=False))
    intake = Intake(passport, said=said, keep=keep)
    intake.findings += noticed
    offered = take_listed(
        intake,
        root,
        passport,
        parse_run_table(_read_small(root / RUN_TABLE, TABLE_MAX_BYTES) or b"", given),
        sets=sets,
        column_map=ColumnMap.of(column_map if column_map is not None else passport.column_map),
        max_file_bytes=max_file_bytes,
        progress=progress,
        given=given,
    )
    return intake, offered


def passport_of(stored: bytes | None) -> tuple[Passport, list[Finding]]:
    """The passport that comes with runs, or the one that is assumed, with a word about it. Raises DatasetError."""
    if stored is not None:
        return parse_passport(stored), []
    message = (
        "no passport given: VIPER on lunar regolith is assumed (gravity 1.62 m/s2, wheel radius 0.25 m); "
        f"put a {PASSPORT_FILE} beside the runs if anything else was simulated"
    )
    return VIPER_ON_LUNAR_REGOLITH, [warn(PASSPORT_FILE, Code.DEFAULT_PASSPORT, message)]


def take_listed(
    intake: Intake,
    root: Path,
    passport: Passport,
    table: tuple[list[RunEntry], list[Finding]],
    *,
    column_map: ColumnMap | None = None,
    sets: Collection[str] | None = None,
    max_file_bytes: int = DEFAULT_MAX_BYTES,
    max_total_bytes: int | None = None,
    progress: Progress | None = None,
    given: Given | None = None,
) -> list[str]:
    """Hand every run of a parsed run table, whose files lie in `root`, to `intake`; returns the files of them all.

    `given` says what neither the table nor the rows do. `max_total_bytes` bounds all files together, unpacked. Raises
    InvalidValueError for a set that is not there.
    """
    given = given or Given()
    reader = _FileReader(root, max_file_bytes, max_total_bytes)
    every, commented = _without_comments(table[0], reader)
    entries = _chosen(every, sets)
    unlisted = unlisted_in(root, [entry.file for entry in table[0]])
    found = [*table[1], *commented, *check_entries(entries), *unlisted]
    intake.findings += found
    by_file = names_of_files([entry.file for entry in every])
    names = {entry.file: entry.name or by_file[entry.file] for entry in every}
    chosen = _unbarred(entries, found)
    for done, entry in enumerate(chosen):
        if progress is not None:
            progress(done, len(chosen), entry.file)
        read = partial(reader.run, entry.file, passport, column_map, intake.said)
        filled, samples = given.over(entry, read)
        intake.take(filled, names[entry.file], samples)
    intake.findings += given.unused(f"{RUN_TABLE} and its files say it")
    return [entry.file for entry in entries]


class _FileReader:
    """Reads the files of one folder within a bound on all of them."""

    def __init__(self, root: Path, max_file_bytes: int, max_total_bytes: int | None) -> None:
        self._root, self._max_file_bytes, self._bytes_left = root, max_file_bytes, max_total_bytes
        # a name may be written in two forms of Unicode; archives are unpacked in this one
        self._composed = {as_listed(name): name for name in _files_in(root)}

    def has(self, file: str) -> bool:
        """Whether there is such a file."""
        return file in self._composed or _is_file(self._root / file)

    def run(self, file: str, passport: Passport, column_map: ColumnMap | None, said: Alignment) -> Samples:
        """The one run of a file. Raises UnusableFileError."""
        return run_in(self._read(file), passport, column_map, said)

    def _read(self, file: str) -> Table:
        left = self._bytes_left
        most = self._max_file_bytes if left is None else max(0, min(self._max_file_bytes, left))
        path = _inside(self._root, file if _is_file(self._root / file) else self._composed.get(file, file))
        if _is_parquet(path):
            size = path.stat().st_size
            if left is not None:
                self._bytes_left = max(0, left - size)
            return _parquet(path, file, most)
        if left is not None:
            # all of it is spent until the file turns out smaller: a bomb uses what it may, and is refused then
            self._bytes_left = left - most
        with path.open("rb") as stream:
            data = read_bounded(stream, file=file, max_bytes=most)
        if left is not None:
            self._bytes_left = left - len(data)
        return parse_text(data, file=file)


def _is_parquet(path: Path) -> bool:
    with path.open("rb") as stream:
        return kind_of(stream.read(HEAD_BYTES)) is Kind.PARQUET


def _parquet(path: Path, file: str, max_bytes: int) -> Table:
    """A Parquet file that holds one run. Raises UnusableFileError."""
    size = path.stat().st_size
    if size > max_bytes:
        message = f"has {size} bytes, allowed are at most {max_bytes}"
        raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])
    limits = UploadLimits(rows=MAX_ROWS_PER_RUN, total_bytes=max_bytes)
    if declares_our_format(path, file=file, limits=limits):
        message = "is a whole dataset in one Parquet file; upload it alone"
        raise UnusableFileError([reject(file, Code.UNSUPPORTED_FORMAT, message)])
    return ParquetTable(path, file)


def _read_small(path: Path, max_bytes: int, *, needed: bool = True) -> bytes | None:
    if not needed and not path.exists():
        return None
    if path.exists() and not path.is_file():  # to open a pipe is to wait for who writes into it
        raise DatasetError(f"{path.name} in the dataset's folder is no plain file")
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


def names_of_files(listed: Iterable[str]) -> dict[str, str]:
    """Run names: files without their endings, and without the folder that all of them share."""
    files = list(dict.fromkeys(listed))
    parents = [str(PurePosixPath(file).parent) for file in files]
    shared = os.path.commonpath(parents) if parents else "."
    short = {file: str(PurePosixPath(file).relative_to(shared)) for file in files}
    stems = {file: _without_endings(text) for file, text in short.items()}
    usable = len(set(stems.values())) == len(stems) and not any(map(unsafe_path, stems.values()))
    return stems if usable else short


def _without_endings(text: str) -> str:
    for ending in (".gz", ".csv", ".txt", ".dat", ".parquet"):
        text = text.removesuffix(ending)
    return text


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # a name that is too long, for one
        return False


def _inside(root: Path, file: str) -> Path:
    """The file, once links are followed, is a regular file inside the folder. Raises UnusableFileError."""
    try:
        path = (root / file).resolve()
    except (RuntimeError, OSError) as error:
        message = f"is a link that cannot be followed ({error}); put the file itself inside"
        raise UnusableFileError([reject(file, Code.LINK, message)]) from error
    if not path.is_relative_to(root.resolve()):
        message = "leads out of the dataset's folder; put the file itself inside"
        raise UnusableFileError([reject(file, Code.UNSAFE_PATH, message)])
    if not _is_file(path):
        raise UnusableFileError([reject(file, Code.MISSING_FILE, f"listed in {RUN_TABLE} but not in the folder")])
    return path


def _without_comments(entries: list[RunEntry], reader: _FileReader) -> tuple[list[RunEntry], list[Finding]]:
    """A line of runs.csv that begins as comments do is a run only where there is such a file."""
    kept, findings = list[RunEntry](), list[Finding]()
    for entry in entries:
        if not entry.file.startswith(COMMENTS) or reader.has(entry.file):
            kept.append(entry)
        else:
            message = f"taken for a comment: there is no file {entry.file!r}"
            findings.append(warn(RUN_TABLE, Code.COMMENT, message, row=entry.line))
    return kept, findings


def unlisted_in(root: Path, listed: Collection[str], below: str = "") -> list[Finding]:
    """Files in `root` that nobody reads: forgotten runs, most likely. `listed` are names within its folder `below`."""
    known = {PurePosixPath(below, name).as_posix() for name in (*listed, RUN_TABLE, PASSPORT_FILE)}
    every = sorted(name for name in map(as_listed, _files_in(root)) if name not in known)
    others = [name for name in every if not _for_people(name) and not is_of_desktop(name)]
    message = f"not listed in {RUN_TABLE}, so not read"
    found = [warn(name, Code.UNLISTED_FILE, message) for name in others[:MAX_LOCATED]]
    if len(others) > MAX_LOCATED:
        message = f"{len(others) - MAX_LOCATED} more files are not listed in it, so not read"
        found.append(warn(RUN_TABLE, Code.UNLISTED_FILE, message))
    return [*found, *of_desktop([name for name in every if is_of_desktop(name)], RUN_TABLE)]


def of_desktop(names: Sequence[str], file: str) -> list[Finding]:
    """A word about files that nobody put there."""
    listed = ", ".join(names[:3])
    message = f"{len(names)} files that desktops add by themselves are not read: {listed}"
    return [warn(file, Code.UNLISTED_FILE, message)] if names else []


def _for_people(name: str) -> bool:
    """Texts, figures and programs: no runs, whatever is in them."""
    path = PurePosixPath(name.lower())
    if path.name == PASSPORT_FILE:
        return False
    return path.suffix in _NO_RUNS or path.stem in ("readme", "license", "changelog", "notes")


def _files_in(root: Path) -> Iterator[str]:
    for directory, _, files in os.walk(root):
        for file in files:
            yield (Path(directory) / file).relative_to(root).as_posix()
