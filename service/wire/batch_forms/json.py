"""A batch as one JSON object of columns: `service.wire.batch_answer.BatchAnswer`, or that of drives."""

from __future__ import annotations

from typing import Any

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.numbers import column_text, columns_text, dump_finite, require_finite, require_finite_tables


def encode_batch_json(subject: BatchWritable) -> bytes:
    """UTF-8. Each column has an entry for each scenario answered: a number, or a list with one for each of its times.

    `time_s` is one list where all scenarios share it, else a list of lists. Raises NonFiniteError.
    """
    counts, time, about = subject.counts(), subject.time_s(), subject.about()
    tables, extras = subject.tables(), subject.extras()
    require_finite_tables(tables, "answer")
    require_finite([extras, about], "answer")
    answer: dict[str, Any] = {"model": about["model"], "frame": about["frame"], **tables, **extras}
    for group, columns in subject.groups().items():
        texts = {name: columns_text(name, each, counts) for name, each in columns.items()}
        answer[group] = {**about.get(group, {}), **texts}
    shared = column_text("time_s", time) if time.ndim == 1 else columns_text("time_s", time, counts)
    answer["trajectory"] = {"time_s": shared, **answer["trajectory"]}
    return dump_finite(answer | {"errors": about["errors"]})
