"""A batch as lines of JSON, one for each scenario or drive in the order they were sent: read one, then the next."""

from __future__ import annotations

from collections.abc import Iterator

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.json import encode_json
from service.wire.forms.numbers import dump

_CHUNK_BYTES = 1 << 16


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
    failures = {int(each["index"]): each for each in subject.failures}
    rows = {int(index): row for row, index in enumerate(subject.indices)}
    for index in sorted((*failures, *rows)):
        if index in failures:
            yield dump(failures[index])
        else:
            yield b'{"index":%d,' % index + encode_json(subject.one(rows[index]))[1:]
