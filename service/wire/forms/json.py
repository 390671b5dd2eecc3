"""A prediction or a drive as one JSON object: the field names of its wire model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, cast

import numpy.typing as npt

from service.twin import NonFiniteError
from service.wire.forms.numbers import column_text, dump_finite, require_finite, require_finite_columns
from service.wire.forms.subject import ColumnTexts, Subject, Writable
from service.wire.prediction_text import prediction_text


class Grouped(Writable, Protocol):
    """A drive, which orjson writes."""

    def groups(self) -> Mapping[str, Mapping[str, npt.NDArray[Any]]]:
        """The columns as the JSON answer has them: `trajectory`, and what else was asked for."""
        ...

    def answer(self, texts: ColumnTexts) -> dict[str, Any]:
        """The JSON answer, for orjson, with the columns of `groups` as texts."""
        ...


def encode_json(subject: Writable) -> bytes:
    """The whole answer, UTF-8. Raises NonFiniteError."""
    if isinstance(subject, Subject):
        return prediction_text(subject)
    drive = cast(Grouped, subject)
    require_finite(drive.scalars(), "answer")
    try:
        groups = drive.groups().items()
        texts = {group: {name: column_text(name, each) for name, each in columns.items()} for group, columns in groups}
        return dump_finite(drive.answer(texts))
    except NonFiniteError:
        require_finite_columns(drive.columns(), "answer")  # which says where
        raise
