"""A prediction or a drive as a table: one header line, one line per time. What is no column goes into headers."""

from __future__ import annotations

from service.twin import NonFiniteError
from service.wire.digits import Writer
from service.wire.forms.numbers import require_finite_columns, table_column
from service.wire.forms.subject import Writable


def encode_csv(subject: Writable) -> bytes:
    """Lines of comma-separated numbers, each ended by a line feed; true is 1, false 0. Raises NonFiniteError.

    The digits are those of the JSON answer.
    """
    columns = subject.columns()
    try:
        texts = [table_column(name, values) for name, values in columns.items()]
        pieces = [b"", *[b","] * (len(texts) - 1), b"\n"]
        writer = Writer()
        writer.raw(",".join(columns).encode() + b"\n")
        writer.table(texts, pieces, len(columns["time_s"]))
        return writer.done()
    except NonFiniteError:
        require_finite_columns(columns, "answer")  # which says where
        raise
