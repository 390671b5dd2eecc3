"""Which file of an archive without runs.csv is the table: the one that has the columns of runs."""

from __future__ import annotations

from pathlib import Path

from service.datasets.file_names import is_of_desktop
from service.datasets.findings import MAX_LOCATED, Code, Finding, UnusableFileError, reject, warn
from service.datasets.intake import names_of
from service.datasets.passport import PASSPORT_FILE, Passport
from service.datasets.readers.column_map import ColumnMap, Resolution, resolve
from service.datasets.readers.foreign import unsupported
from service.datasets.readers.foreign_parquet import ParquetTable
from service.datasets.readers.long_table import NUMBER_LABELS, TEXT_LABELS
from service.datasets.readers.sniff import HEAD_BYTES, Kind, kind_of
from service.datasets.readers.source import read_start
from service.datasets.readers.table import Table
from service.datasets.readers.text_lines import whole_lines
from service.datasets.readers.text_table import parse_text
from service.datasets.run_table import FILE as RUN_TABLE

_ENDINGS = (".csv", ".txt", ".dat", ".tsv", ".out", ".asc", ".prn", ".parquet", ".gz")
_START_BYTES = 256 << 10


def only_table(root: Path, passport: Passport, column_map: ColumnMap | None) -> tuple[Path, list[Finding]]:
    """The table, and a word about every other file. Raises UnusableFileError where there is none, or several."""
    every = sorted(each for each in root.rglob("*") if each.is_file())
    files = [each for each in every if each.name != PASSPORT_FILE and not is_of_desktop(each.name)]
    data = [each for each in files if each.name.lower().endswith(_ENDINGS)] or files
    chosen = data if len(data) == 1 else [each for each in data if _is_table(each, passport, column_map)]
    if len(chosen) != 1:
        foreign = [] if chosen else [_foreign(each, each.relative_to(root).as_posix()) for each in files[:MAX_LOCATED]]
        if any(foreign):
            raise UnusableFileError([finding for finding in foreign if finding])
        listed = ", ".join(repr(each.relative_to(root).as_posix()) for each in (chosen or files)[:5])
        what = f"{len(chosen)} tables ({listed})" if chosen else f"{len(files)} other files ({listed})"
        message = f"is not in the archive, which has {what}; it must list file, slope, mass, torque"
        raise UnusableFileError([reject(RUN_TABLE, Code.MISSING_FILE, message)])
    message = f"not read, since {chosen[0].relative_to(root).as_posix()!r} is the table of runs"
    others = [each.relative_to(root).as_posix() for each in files if each != chosen[0]]
    if len(others) > 1:
        message = f"and {len(others) - 1} more files are {message}"
    return chosen[0], [warn(others[0], Code.UNLISTED_FILE, message)] if others else []


def _is_table(path: Path, passport: Passport, column_map: ColumnMap | None) -> bool:
    """Whether the beginning of the file has the columns of runs, and numbers in them."""
    try:
        start = read_start(path, _START_BYTES)
        kind = kind_of(start[:HEAD_BYTES])
        if kind is Kind.PARQUET:
            return path.suffix == ".gz" or bool(_found(ParquetTable(path, path.name), passport, column_map).indices)
        if kind is not Kind.TEXT:
            return False
        table = parse_text(start if len(start) < _START_BYTES else whole_lines(start), file=path.name)
        found = _found(table, passport, column_map)
        table.numbers([index for name, index in found.indices.items() if name not in TEXT_LABELS], flags=found.flags)
    except UnusableFileError:
        return False
    return True


def _foreign(path: Path, file: str) -> Finding | None:
    """A word about a file that is a known format of others."""
    try:
        return unsupported(read_start(path, HEAD_BYTES), file)
    except UnusableFileError:
        return None


def _found(table: Table, passport: Passport, column_map: ColumnMap | None) -> Resolution:
    """The columns that are wanted. Raises UnusableFileError."""
    labels = (*TEXT_LABELS, *NUMBER_LABELS)
    names = names_of(table, passport)
    return resolve(names, table.width, column_map, file=table.file, labels=labels)
