"""Datasets as one Parquet file: a long table, one row group per run, numbers as decimals.

Columns: `run`, `set`, `slope_deg`, `mass_kg`, `torque_nm`, `horizon_s` (dictionary encoded, so they cost nothing
where they are constant within a run; slope and torque may change from row to row) and the measured columns as
decimal(9, digits), stored as 32-bit integers, delta-encoded: 0.7-1.0 byte a value. Where no wheel is ever locked
`brake` is null. Any Parquet tool reads it; with pandas, cast the decimals:
`pyarrow.parquet.read_table(file)` then `table.column(name).cast("float64")`. Passport and name of the dataset
are in the file's key-value metadata under `rover-twin.*`.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Iterator
from typing import BinaryIO

import numpy as np
import pyarrow as pa
from pyarrow import parquet as pq

from service.datasets.columns import BY_NAME, COLUMNS, INPUTS, MAX_COLUMNS, REQUIRED
from service.datasets.digest import stored_integers
from service.datasets.passport import Passport, parse_passport
from service.datasets.run import MAX_ROWS_PER_RUN, MAX_RUNS, MAX_TOTAL_ROWS, Array, Dataset, Run
from service.errors import DatasetError, InvalidValueError

FORMAT = "rover-twin-runs/1"
PRECISION = 9
_TEXTS = ("run", "set")
_SCENARIO = ("slope_deg", "mass_kg", "torque_nm", "horizon_s")
_MAY_CHANGE = tuple(name for name in INPUTS if name in _SCENARIO)
_MEASURED = tuple(column.name for column in COLUMNS if column.name not in _SCENARIO)
_META_FORMAT, _META_NAME, _META_PASSPORT = b"rover-twin.format", b"rover-twin.name", b"rover-twin.passport"
_TEXT_TYPE = pa.dictionary(pa.int32(), pa.string())


def write_parquet(dataset: Dataset, sink: str | BinaryIO, *, compression_level: int = 19) -> None:
    """Write the dataset, values rounded to their stored digits (see `columns`).

    Raises DatasetError naming run, column and value when a value needs more than nine digits.
    """
    present = [name for name in _MEASURED if any(name in run.columns for run in dataset.runs)]
    schema = _schema(dataset, present)
    with pq.ParquetWriter(
        sink,
        schema,
        compression="zstd",
        compression_level=compression_level,
        store_decimal_as_integer=True,
        use_dictionary=[*_TEXTS, *_SCENARIO],
        column_encoding=dict.fromkeys(present, "DELTA_BINARY_PACKED"),
    ) as writer:
        for run in dataset.runs:
            writer.write_table(_table(run, schema), row_group_size=len(run))


def to_parquet(dataset: Dataset, *, compression_level: int = 19) -> bytes:
    """The same in memory."""
    sink = io.BytesIO()
    write_parquet(dataset, sink, compression_level=compression_level)
    return sink.getvalue()


def read_parquet(
    source: bytes | str | BinaryIO,
    *,
    columns: Collection[str] | None = None,
    runs: Collection[str] | None = None,
    sets: Collection[str] | None = None,
) -> Dataset:
    """Read a dataset, or only some columns, runs and sets.

    The required columns always come, and so do slope, torque and brake of runs in which they change: without them a
    run would look like one under constant slope and torque.

    Raises DatasetError for a file that is not ours, is damaged or is larger than allowed, or where no run is
    left; InvalidValueError for unknown column names.
    """
    unknown = sorted(set(columns or ()) - set(BY_NAME))
    if unknown:
        raise InvalidValueError("columns", unknown, f"columns among {', '.join(BY_NAME)}")
    try:
        file = pq.ParquetFile(io.BytesIO(source) if isinstance(source, bytes) else source)
        _bound(file)
        name, passport = _metadata(file)
        chosen = tuple(_runs(file, columns, runs, sets))
        if not chosen:
            raise DatasetError(f"no run of dataset {name} fits runs={runs} and sets={sets}")
        return Dataset(name, passport, chosen)
    # ValueError: values that a Run refuses, Arrow's own errors, text that is not UTF-8
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        raise DatasetError(f"not a readable Parquet file of runs: {error}") from error


def is_ours(file: pq.ParquetFile) -> bool:
    """Whether the file says that it is of this format (of any major version)."""
    metadata = file.schema_arrow.metadata or {}
    return _META_FORMAT in metadata


def unknown_columns(source: str) -> tuple[str, ...]:
    """Columns of a file of ours that nobody reads."""
    with pq.ParquetFile(source) as file:
        known = {*_TEXTS, *_SCENARIO, *_MEASURED}
        return tuple(name for name in file.schema_arrow.names if name not in known)


def _schema(dataset: Dataset, present: list[str]) -> pa.Schema:
    fields = [pa.field(name, _TEXT_TYPE, nullable=False) for name in _TEXTS]
    fields += [pa.field(name, pa.float64(), nullable=False) for name in _SCENARIO]
    fields += [
        pa.field(name, _decimal(name), nullable=name not in REQUIRED, metadata={b"unit": BY_NAME[name].unit.encode()})
        for name in present
    ]
    metadata = {
        _META_FORMAT: FORMAT.encode(),
        _META_NAME: dataset.name.encode(),
        _META_PASSPORT: dataset.passport.canonical_json().encode(),
    }
    return pa.schema(fields, metadata=metadata)


def _decimal(name: str) -> pa.DataType:
    return pa.decimal128(PRECISION, BY_NAME[name].digits)


def _table(run: Run, schema: pa.Schema) -> pa.Table:
    rows = len(run)
    constants = {"run": run.name, "set": run.set_name}
    first = pa.array(np.zeros(rows, dtype=np.int32))
    arrays = [pa.DictionaryArray.from_arrays(first, pa.array([constants[name]])) for name in _TEXTS]
    arrays += [pa.array(_scenario_column(run, name)) for name in _SCENARIO]
    arrays += [_column(run, field.name, field.type) for field in list(schema)[len(arrays) :]]
    return pa.Table.from_arrays(arrays, schema=schema)


def _scenario_column(run: Run, name: str) -> Array:
    """One value for all rows; of what changes within the run, each row's, at its stored digits."""
    if name in run.columns:
        return stored_integers(run, name) / BY_NAME[name].scale
    return np.full(len(run), float(getattr(run, name)))


def _column(run: Run, name: str, decimal_type: pa.DataType) -> pa.Array:
    """A column as decimals, built from integers: exact, and without one Python object per value."""
    if name not in run.columns:
        return pa.nulls(len(run), decimal_type)
    # compared as floats: a huge value would wrap around as an integer
    magnitude = np.abs(np.rint(run.columns[name] * BY_NAME[name].scale))
    if magnitude.max() >= 10**PRECISION:
        value, most = run.columns[name][magnitude.argmax()], 10.0**PRECISION / BY_NAME[name].scale
        raise DatasetError(
            f"{name} of run {run.name} is {value:g}, allowed is below {most:g} {BY_NAME[name].unit}: "
            f"it is stored with {PRECISION} digits, {BY_NAME[name].digits} of them decimals"
        )
    integers = stored_integers(run, name)
    halves = np.empty((len(run), 2), dtype="<i8")  # 128-bit little-endian: low word, then the sign
    halves[:, 0], halves[:, 1] = integers, integers >> 63
    return pa.Array.from_buffers(decimal_type, len(run), [None, pa.py_buffer(halves)])


def _bound(file: pq.ParquetFile) -> None:
    """Sizes that the footer declares, before anything is decoded."""
    meta = file.metadata
    for what, value, most in (
        ("runs", meta.num_row_groups, MAX_RUNS),
        ("rows", meta.num_rows, MAX_TOTAL_ROWS),
        ("columns", meta.num_columns, MAX_COLUMNS),
        ("rows in a run", max((meta.row_group(i).num_rows for i in range(meta.num_row_groups)), default=0),
         MAX_ROWS_PER_RUN),
    ):  # fmt: skip
        if value > most:
            raise DatasetError(f"the Parquet file has {value} {what}, allowed are at most {most}")


def _metadata(file: pq.ParquetFile) -> tuple[str, Passport]:
    """(name, passport). Columns beside ours are ignored by never being read; ours must have our type."""
    schema = file.schema_arrow
    metadata = schema.metadata or {}
    declared = metadata.get(_META_FORMAT, b"").decode("utf-8", "replace")
    if declared.partition(".")[0] != FORMAT:
        raise DatasetError(f"the Parquet file is of format {declared!r}, expected {FORMAT!r}")
    for name in (*_TEXTS, *_SCENARIO, *REQUIRED):
        if name not in schema.names:
            raise DatasetError(f"the Parquet file has no column {name}")
    for field in schema:
        if field.name in _MEASURED and field.type != _decimal(field.name):
            raise DatasetError(f"column {field.name} has type {field.type}, expected {_decimal(field.name)}")
    name = metadata.get(_META_NAME, b"").decode("utf-8", "replace")
    return name, parse_passport(metadata.get(_META_PASSPORT, b""), file=_META_PASSPORT.decode())


def _runs(
    file: pq.ParquetFile, columns: Collection[str] | None, runs: Collection[str] | None, sets: Collection[str] | None
) -> Iterator[Run]:
    available = [name for name in _MEASURED if name in file.schema_arrow.names]
    always = {*REQUIRED, *INPUTS}
    wanted = [name for name in available if columns is None or name in columns or name in always]
    for index in range(file.num_row_groups):
        labels = file.read_row_group(index, columns=[*_TEXTS, *_SCENARIO], use_threads=False)
        text = {name: str(_constant(labels, name, index)) for name in _TEXTS}
        if (runs is not None and text["run"] not in runs) or (sets is not None and text["set"] not in sets):
            continue
        changing = {name: _each_row(labels, name, index) for name in _MAY_CHANGE if not _is_constant(labels, name)}
        slope, mass, torque, horizon = (
            float(changing[name][0] if name in changing else _constant(labels, name, index)) for name in _SCENARIO
        )
        table = file.read_row_group(index, columns=wanted, use_threads=False)
        arrays = {name: _floats(table.column(name), name, text["run"]) for name in wanted}
        kept = {name: array for name, array in arrays.items() if array is not None}
        yield Run(text["run"], text["set"], slope, mass, torque, horizon, kept | changing)


def _is_constant(labels: pa.Table, name: str) -> bool:
    return len(labels.column(name).unique()) == 1


def _each_row(labels: pa.Table, name: str, index: int) -> Array:
    """A column of the scenario that changes within a run."""
    column = labels.column(name)
    if column.null_count:
        raise DatasetError(f"{name} of row group {index} has {column.null_count} empty values, expected none")
    return np.asarray(column.to_numpy(), dtype=np.float64)


def _constant(labels: pa.Table, name: str, index: int) -> str | float:
    """The one value of a column that is constant within a run."""
    values = labels.column(name).unique()
    if len(values) != 1 or not values[0].is_valid:
        raise DatasetError(f"row group {index} must be one run with one {name}, it has {len(values)} values")
    value: str | float = values[0].as_py()
    return value


def _floats(chunked: pa.ChunkedArray, name: str, run: str) -> Array | None:
    """Decimals as float64 (time,), each the double nearest to its decimal; None for a run without this column.

    Read from the integers: Arrow's own cast multiplies by 10^-digits and is off in the last bit.
    """
    column = chunked.combine_chunks()
    if column.null_count == len(column):
        return None
    if column.null_count:
        raise DatasetError(f"{name} of run {run} has {column.null_count} empty values, expected none")
    words = np.frombuffer(column.buffers()[1], dtype="<i8")[::2]
    return words[column.offset : column.offset + len(column)] / BY_NAME[name].scale
