"""A Parquet file that another tool wrote: columns by name, as a table of one run or a long table of many."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet as pq

from service.datasets.columns import MAX_COLUMNS
from service.datasets.findings import Code, Finding, UnusableFileError, reject
from service.datasets.parquet import is_ours
from service.datasets.readers.table import Array, Numbers, Texts
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


class ParquetTable:
    """A `Table` of Parquet, by the names of its columns; rows are counted from 1.

    Rows without any value are left out, as blank lines of a text are. Raises UnusableFileError for a broken file.
    """

    def __init__(self, path: Path, file: str) -> None:
        self._path, self.file = path, file
        self.noticed: tuple[Finding, ...] = ()
        with _opened(path, file) as opened:
            self._schema = opened.schema_arrow
            rows = opened.metadata.num_rows
        self.names = tuple(self._schema.names)
        self.width = len(self.names)
        self._kept = self._rows_with_values(rows)
        self.lines = np.flatnonzero(self._kept).astype(np.int64) + 1
        if not len(self.lines):
            raise UnusableFileError([reject(file, Code.EMPTY_FILE, "no rows in it")])

    def numbers(self, indices: Sequence[int], *, flags: Collection[int] = ()) -> list[Numbers]:  # noqa: ARG002
        """These columns; true and false are 1 and 0 in all of them.

        Raises UnusableFileError for columns of something else.
        """
        faults = [fault for index in indices for fault in self._type_faults(index, is_text=False)]
        if faults:
            raise UnusableFileError(faults)
        return [self._floats(index) for index in indices]

    def texts(self, index: int) -> Texts:
        """One column of texts, or of numbers as such. Raises UnusableFileError for a column of something else."""
        faults = list(self._type_faults(index, is_text=True))
        if faults:
            raise UnusableFileError(faults)
        column = self._column(index)
        if pa.types.is_dictionary(column.type):
            column = column.dictionary_decode()
        encoded = pc.fill_null(pc.cast(column, pa.string()), "").dictionary_encode()
        return Texts(encoded.indices.to_numpy().astype(np.int64), tuple(encoded.dictionary.to_pylist()))

    def _rows_with_values(self, rows: int) -> npt.NDArray[np.bool_]:
        """Which rows have a value in any column, (row,)."""
        empty = np.ones(rows, dtype=np.bool_)
        with _opened(self._path, self.file) as opened:
            for name in dict.fromkeys(self.names):
                if not empty.any():
                    break
                for column in _read(opened, name, self.file).columns:
                    empty &= column.is_null().to_numpy()
        return ~empty

    def _type_faults(self, index: int, *, is_text: bool) -> Iterator[Finding]:
        kind = self._schema.field(index).type
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        number = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_boolean, pa.types.is_null)
        text = (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
        if not any(test(kind) for test in (*number, *(text if is_text else ()))):
            expected = "texts or numbers" if is_text else "numbers"
            yield reject(self.file, Code.NOT_A_NUMBER, f"holds {kind}, expected {expected}", column=self.names[index])

    def _column(self, index: int) -> pa.Array:
        """The only column of this name: two are refused before any is read."""
        with _opened(self._path, self.file) as opened:
            column = _read(opened, self.names[index], self.file).column(0)
        return column.combine_chunks().filter(pa.array(self._kept))

    def _floats(self, index: int) -> Numbers:
        column = self._column(index)
        if pa.types.is_dictionary(column.type):
            column = column.dictionary_decode()
        values: Array = pc.cast(column, pa.float64(), safe=False).to_numpy(zero_copy_only=False)
        return Numbers(values, column.is_null().to_numpy(zero_copy_only=False) if column.null_count else None)


@contextmanager
def _opened(path: Path, file: str) -> Iterator[pq.ParquetFile]:
    try:
        with pq.ParquetFile(path) as opened:
            yield opened
    except (pa.ArrowException, OSError, ValueError) as error:
        raise broken(file, error) from error


def _read(opened: pq.ParquetFile, name: str, file: str) -> pa.Table:
    """All columns of this name. Raises UnusableFileError."""
    try:
        return opened.read(columns=[name], use_threads=False)
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
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
