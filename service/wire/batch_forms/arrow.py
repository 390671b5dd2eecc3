"""A batch as an Arrow IPC stream in long form: `pyarrow.ipc.open_stream(body).read_all()`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.arrow import stream_of
from service.wire.forms.numbers import dump, dump_finite, require_finite_columns, require_finite_tables

if TYPE_CHECKING:
    import pyarrow as pa


def encode_batch_arrow(subject: BatchWritable) -> bytes:
    """The IPC stream of `long_batch_of`. Raises NonFiniteError."""
    return stream_of(long_batch_of(subject))


def long_batch_of(subject: BatchWritable) -> pa.RecordBatch:
    """One record batch, a row for each scenario, or drive, and time: `scenario` or `drive` (int32, its place in the
    request), then float64 or bool.

    The metadata of the schema has `frame` as plain text and, as JSON, the other names of `BatchWritable.about`, its
    `tables` and `extras`; the metadata of each field its `unit`. Raises NonFiniteError.
    """
    import pyarrow as pa  # noqa: PLC0415 - half a second that only those pay who ask for Arrow

    about, counts = subject.about(), subject.counts()
    long, tables = _long(subject), subject.tables()
    require_finite_columns(long, "answer")
    require_finite_tables(tables, "answer")
    index = np.repeat(subject.indices.astype(np.int32), counts)
    units = about["units"]
    arrays = [pa.array(values) for values in (index, *long.values())]
    fields = [pa.field(subject.index_name, pa.int32(), nullable=False)]
    for name, each in zip(long, arrays[1:], strict=True):
        fields.append(pa.field(name, each.type, nullable=False, metadata={"unit": units[name]}))
    metadata = {name: part if isinstance(part, str) else dump(part) for name, part in about.items()}
    metadata |= {name: dump_finite(table) for name, table in tables.items()}
    metadata |= {name: dump(part) for name, part in subject.extras().items()}
    return pa.record_batch(arrays, pa.schema(fields, metadata))


def _long(subject: BatchWritable) -> dict[str, npt.NDArray[Any]]:
    """Time and the columns, row after row, each without what only fills it up."""
    counts, time, columns = subject.counts(), subject.time_s(), subject.columns()
    most = time.shape[-1]
    if (counts == most).all():
        times = np.tile(time, len(counts)) if time.ndim == 1 else time.ravel()
        return {"time_s": times, **{name: column.ravel() for name, column in columns.items()}}
    own = np.arange(most) < counts[:, None]
    return {"time_s": time[own], **{name: column[own] for name, column in columns.items()}}
