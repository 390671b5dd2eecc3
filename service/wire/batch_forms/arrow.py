"""A batch as an Arrow IPC stream in long form: `pyarrow.ipc.open_stream(body).read_all()`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.arrow import stream_of_columns
from service.wire.forms.numbers import dump, dump_finite, require_finite_columns, require_finite_tables

if TYPE_CHECKING:
    import pyarrow as pa


def encode_batch_arrow(subject: BatchWritable) -> bytes:
    """The IPC stream of `long_batch_of`. Raises NonFiniteError."""
    return stream_of_columns(*_described(subject))


def long_batch_of(subject: BatchWritable) -> pa.RecordBatch:
    """One record batch, a row for each scenario, or drive, and time: `scenario` or `drive` (int32, its place in the
    request), then float64 or bool.

    The metadata of the schema has `frame` as plain text and, as JSON, the other names of `BatchWritable.about`, its
    `tables` and `extras`; the metadata of each field its `unit`. Raises NonFiniteError.
    """
    import pyarrow as pa  # noqa: PLC0415 - half a second that only those pay who ask for Arrow

    columns, schema = _described(subject)
    return pa.record_batch([pa.array(np.concatenate(pieces)) for pieces in columns.values()], schema)


def _described(subject: BatchWritable) -> tuple[Mapping[str, Sequence[npt.NDArray[Any]]], pa.Schema]:
    """The columns of `long_batch_of`, in pieces, and its schema. Raises NonFiniteError."""
    import pyarrow as pa  # noqa: PLC0415 - as above

    about, counts = subject.about(), subject.counts()
    long, tables = _long(subject), subject.tables()
    require_finite_columns({name: pieces[0] for name, pieces in long.items()}, "answer")
    require_finite_tables(tables, "answer")
    index = np.repeat(subject.indices.astype(np.int32), counts)
    units = about["units"]
    fields = [pa.field(subject.index_name, pa.int32(), nullable=False)]
    for name, pieces in long.items():
        kind = pa.from_numpy_dtype(pieces[0].dtype)
        fields.append(pa.field(name, kind, nullable=False, metadata={"unit": units[name]}))
    metadata = {name: part if isinstance(part, str) else dump(part) for name, part in about.items()}
    metadata |= {name: dump_finite(table) for name, table in tables.items()}
    metadata |= {name: dump(part) for name, part in subject.extras().items()}
    return {subject.index_name: [index], **long}, pa.schema(fields, metadata)


def _long(subject: BatchWritable) -> dict[str, Sequence[npt.NDArray[Any]]]:
    """Time and the columns, row after row, without what only fills rows up; times that all share, once for each."""
    counts, time, columns = subject.counts(), subject.time_s(), subject.columns()
    most = time.shape[-1]
    if (counts == most).all():
        times = [time.ravel()] if time.ndim > 1 else [time] * len(counts) or [time[:0]]
        return {"time_s": times, **{name: [column.ravel()] for name, column in columns.items()}}
    own = np.arange(most) < counts[:, None]
    return {"time_s": [time[own]], **{name: [column[own]] for name, column in columns.items()}}
