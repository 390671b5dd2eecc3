"""A batch as lines of JSON, one for each scenario or drive in the order they were sent: read one, then the next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import orjson

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.numbers import (
    column_text,
    dump,
    dump_finite,
    require_finite,
    require_finite_tables,
    row_texts,
)
from service.wire.forms.subject import ColumnTexts

_CHUNK_BYTES, _CHUNK_NUMBERS = 1 << 16, 1 << 14


def batch_lines(subject: BatchWritable) -> Iterator[bytes]:
    """Each line is what the single route answers to it, with its `index` first; or that and its problem.

    The lines of about 64 KiB come together.
    """
    waiting = bytearray()
    for line in _lines(subject):
        waiting += line
        waiting += b"\n"
        if len(waiting) >= _CHUNK_BYTES:
            yield bytes(waiting)
            waiting.clear()
    yield bytes(waiting)


def _lines(subject: BatchWritable) -> Iterator[bytes]:
    require_finite_tables(subject.tables(), "answer")
    require_finite(subject.extras(), "answer")
    failures = {int(each["index"]): each for each in subject.failures}
    rows = enumerate(_texts(subject))
    for index in sorted((*failures, *subject.indices.tolist())):
        if index in failures:
            yield dump(failures[index])
        else:
            row, texts = next(rows)  # they come in the order of `indices`, which rise
            yield b'{"index":%d,' % index + dump_finite(subject.one(row).answer(texts))[1:]


def _texts(subject: BatchWritable) -> Iterator[ColumnTexts]:
    """The columns of one row after the other; those of some rows are written at once."""
    counts, time, groups = subject.counts(), subject.time_s(), subject.groups()
    some = max(1, _CHUNK_NUMBERS // max(1, time.shape[-1]))
    for begin in range(0, len(counts), some):
        part = slice(begin, begin + some)
        own = counts[part]
        times = [column_text("time_s", time)] * len(own) if time.ndim == 1 else row_texts("time_s", time[part], own)
        named = {
            group: {name: row_texts(name, values[part], own) for name, values in columns.items()}
            for group, columns in groups.items()
        }
        named["trajectory"] = {"time_s": times, **named["trajectory"]}
        for row in range(len(own)):
            yield {group: _of_row(columns, row) for group, columns in named.items()}


def _of_row(columns: Mapping[str, Sequence[orjson.Fragment]], row: int) -> dict[str, orjson.Fragment]:
    return {name: texts[row] for name, texts in columns.items()}
