"""A batch as one JSON object of columns: `service.wire.batch_answer.BatchAnswer`, or that of drives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.numbers import dump


def encode_batch_json(subject: BatchWritable) -> bytes:
    """UTF-8. Each column has an entry for each scenario answered: a number, or a list with one for each of its times.

    `time_s` is one list where all scenarios share it, else a list of lists. Raises NonFiniteError.
    """
    counts, time, about = subject.counts(), subject.time_s(), subject.about()
    answer: dict[str, Any] = {"model": about["model"], "frame": about["frame"], **subject.tables(), **subject.extras()}
    for group, columns in subject.groups().items():
        answer[group] = {**about.get(group, {}), **{name: _rows(each, counts) for name, each in columns.items()}}
    shared = time if time.ndim == 1 else _rows(time, counts)
    answer["trajectory"] = {"time_s": shared, **answer["trajectory"]}
    return dump(answer | {"errors": about["errors"]})


def _rows(column: npt.NDArray[Any], counts: npt.NDArray[np.intp]) -> npt.NDArray[Any] | Sequence[npt.NDArray[Any]]:
    """Each row without what only fills it up."""
    whole = np.ascontiguousarray(column)
    if (counts == column.shape[1]).all():
        return whole
    return [row[:count] for row, count in zip(whole, counts.tolist(), strict=True)]
