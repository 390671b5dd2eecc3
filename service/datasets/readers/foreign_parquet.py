"""A Parquet file that another tool wrote: columns by name, as a table of one run or a long table of many."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet as pq

from service.datasets.checks.candidate import Array
from service.datasets.columns import MAX_COLUMNS
from service.datasets.findings import Code, Finding, UnusableFileError, reject
from service.datasets.parquet import is_ours
from service.datasets.readers.chrono_text import TextTable
from service.datasets.readers.column_map import ColumnMap, resolve
from service.datasets.readers.long_table import TEXT_LABELS, LongTable, Texts, label_of
from service.datasets.uploads.upload_form import UploadLimits

_MAX_FOOTER = 16 << 20


def declares_our_format(path: Path, *, file: str, limits: UploadLimits) -> bool:
    """Whether this service wrote the file, by its metadata. Its footer's sizes are checked first.

    Raises UnusableFileError for a broken or oversized file.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        stream.seek(max(0, size - 8))
        tail = stream.read(8)
    length = int.from_bytes(tail[:4], "little")
    if tail[4:] != b"PAR1" or length > size:
        message = "is no whole Parquet file: it does not end as one; upload it again"
        raise UnusableFileError([reject(file, Code.BROKEN_PARQUET, message)])
    if length > _MAX_FOOTER:
        raise UnusableFileError([reject(file, Code.TOO_LARGE, f"its footer has {length} bytes, allowed {_MAX_FOOTER}")])
    try:
        opened = pq.ParquetFile(path)
        with opened:
            _bound(opened, file, limits)
            return is_ours(opened)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise broken(file, error) from error


def broken(file: str, error: Exception) -> UnusableFileError:
    """The error for a file that Arrow cannot read."""
    reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
    message = f"is not a readable Parquet file ({reason}); write it again"
    return UnusableFileError([reject(file, Code.BROKEN_PARQUET, message)])


def read_foreign_parquet(path: Path, column_map: ColumnMap | None, *, file: str) -> tuple[LongTable, list[Finding]]:
    """Labels and the columns of runs that are used; rows are counted from 1. Also what was noticed.

    Raises UnusableFileError for columns that are missing, hold no numbers or have empty cells.
    """
    try:
        with pq.ParquetFile(path) as opened:
            schema = opened.schema_arrow
            labels = {name: label_of(name) for name in schema.names}
            measured = [name for name, label in labels.items() if label is None]
            found = resolve(measured, len(measured), column_map, file=file)
            names = [measured[index] for index in sorted(set(found.indices.values()))]
            wanted = [*names, *(name for name, label in labels.items() if label is not None)]
            _check_types(schema, wanted, labels, file)
            read = opened.read(columns=wanted, use_threads=False)
        lines = np.arange(1, read.num_rows + 1, dtype=np.int64)
        if not read.num_rows:
            raise UnusableFileError([reject(file, Code.EMPTY_FILE, "no rows in it")])
        numbers = {str(label): _floats(read.column(name), name, file)
                   for name, label in labels.items() if label is not None and label not in TEXT_LABELS}  # fmt: skip
        texts = {
            str(label): _texts(read.column(name), name, file) for name, label in labels.items() if label in TEXT_LABELS
        }
        columns = tuple(_floats(read.column(name), name, file) for name in names)
        return LongTable(TextTable(tuple(names), columns, lines), numbers, texts), list(found.findings)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise broken(file, error) from error


def _bound(opened: pq.ParquetFile, file: str, limits: UploadLimits) -> None:
    """Sizes that the footer declares, before anything is decoded."""
    meta = opened.metadata
    unpacked = sum(max(0, meta.row_group(index).total_byte_size) for index in range(min(meta.num_row_groups, 100_000)))
    for what, value, most in (
        ("rows", meta.num_rows, limits.rows),
        ("columns", meta.num_columns, MAX_COLUMNS),
        ("row groups", meta.num_row_groups, 100_000),
        ("bytes once unpacked", unpacked, limits.total_bytes),
    ):
        if not 0 <= value <= most:
            message = f"has {value} {what}, allowed are at most {most}"
            raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])


def _check_types(schema: pa.Schema, wanted: list[str], labels: dict[str, str | None], file: str) -> None:
    faults = []
    for name in wanted:
        kind = schema.field(name).type
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)
        is_text = pa.types.is_string(kind) or pa.types.is_large_string(kind)
        if not (is_number or (is_text and labels[name] in TEXT_LABELS)):
            expected = "texts or numbers" if labels[name] in TEXT_LABELS else "numbers"
            faults.append(reject(file, Code.NOT_A_NUMBER, f"holds {kind}, expected {expected}", column=name))
    if faults:
        raise UnusableFileError(faults)


def _whole(column: pa.ChunkedArray, name: str, file: str) -> pa.Array:
    """One array without gaps."""
    if column.null_count:
        at = int(np.flatnonzero(column.is_null().to_numpy())[0]) + 1
        message = f"no value in this row ({column.null_count} such rows)"
        raise UnusableFileError([reject(file, Code.EMPTY_CELL, message, row=at, column=name)])
    return column.combine_chunks()


def _floats(column: pa.ChunkedArray, name: str, file: str) -> Array:
    array = _whole(column, name, file)
    if pa.types.is_dictionary(array.type):
        array = array.dictionary_decode()
    floats: Array = pc.cast(array, pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    return floats


def _texts(column: pa.ChunkedArray, name: str, file: str) -> Texts:
    array = _whole(column, name, file)
    encoded = array if pa.types.is_dictionary(array.type) else array.dictionary_encode()
    return Texts(encoded.indices.to_numpy().astype(np.int64), tuple(map(str, encoded.dictionary.to_pylist())))
