"""A prediction or a drive as one JSON object: the field names of its wire model."""

from __future__ import annotations

from service.twin import NonFiniteError
from service.wire.forms.numbers import column_text, dump_finite, require_finite, require_finite_columns
from service.wire.forms.subject import Writable


def encode_json(subject: Writable) -> bytes:
    """The whole answer, UTF-8. Raises NonFiniteError."""
    require_finite(subject.scalars(), "answer")
    try:
        groups = subject.groups().items()
        texts = {group: {name: column_text(name, each) for name, each in columns.items()} for group, columns in groups}
        return dump_finite(subject.answer(texts))
    except NonFiniteError:
        require_finite_columns(subject.columns(), "answer")  # which says where
        raise
