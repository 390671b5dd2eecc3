"""A prediction or a drive as a Parquet file: `pandas.read_parquet(io.BytesIO(body))`, `polars.read_parquet(body)`."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from service.wire.forms.arrow import batch_of
from service.wire.forms.subject import Writable

if TYPE_CHECKING:
    import pyarrow as pa


def encode_parquet(subject: Writable) -> bytes:
    """The table of the Arrow form, with its metadata: those of the schema are the file's key-value metadata.

    The unit of each column is in `units` there, and for Arrow's readers in the field's metadata too. Raises
    NonFiniteError.
    """
    return file_of(batch_of(subject))


def file_of(batch: pa.RecordBatch) -> bytes:
    """A Parquet file of one record batch. The same batch gives the same bytes."""
    import pyarrow as pa  # noqa: PLC0415 - as in `service.wire.forms.arrow`
    from pyarrow import parquet as pq  # noqa: PLC0415

    sink = io.BytesIO()
    # snappy is what every reader has; numbers of a trajectory hardly repeat, so a dictionary would only cost time
    pq.write_table(pa.Table.from_batches([batch]), sink, compression="snappy", use_dictionary=False)
    return sink.getvalue()
