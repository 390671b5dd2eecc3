"""A batch as a Parquet file in long form: `pandas.read_parquet(io.BytesIO(body))`."""

from __future__ import annotations

from service.wire.batch_forms.arrow import long_batch_of
from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.parquet import file_of


def encode_batch_parquet(subject: BatchWritable) -> bytes:
    """The table of the Arrow form, a row for each scenario, or drive, and time, with its metadata.

    Raises NonFiniteError.
    """
    return file_of(long_batch_of(subject))
