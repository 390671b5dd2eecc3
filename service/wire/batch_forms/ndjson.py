"""A batch as lines of JSON, one for each scenario or drive in the order sent: a client reads the first at once."""

from __future__ import annotations

from collections.abc import Iterator

import orjson

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.numbers import dump, require_finite, require_finite_tables
from service.wire.lines import Cells, Lines, Lists

_CHUNK_NUMBERS = 1 << 16  # each chunk goes to a thread and back
_OPTIONS = orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_PASSTHROUGH_DATACLASS


def batch_lines(subject: BatchWritable) -> Iterator[bytes]:
    """Each line is what the single route answers to it, with its `index` first; or that and its problem.

    Some lines come together, up to about a megabyte.
    """
    require_finite_tables(subject.tables(), "answer")
    require_finite(subject.extras(), "answer")
    failures = {int(each["index"]): dump(each) + b"\n" for each in subject.failures}
    indices = subject.indices.tolist()
    lines = lines_of(subject) if indices else None
    some = max(1, _CHUNK_NUMBERS // max(1, subject.time_s().shape[-1] * len(subject.columns())))
    for begin in range(0, len(indices), some):
        rows = slice(begin, min(begin + some, len(indices)))
        text = lines.text(rows) if lines else b""
        between = [at for at in failures if at < indices[rows.stop - 1]]
        yield _merged(text, indices[rows], {at: failures.pop(at) for at in between}) if between else text
    if failures:
        yield b"".join(failures[at] for at in sorted(failures))


def _merged(text: bytes, indices: list[int], failures: dict[int, bytes]) -> bytes:
    """The lines of `text`, which have these indices, and the others in their order."""
    every = failures | dict(zip(indices, text.splitlines(keepends=True), strict=True))
    return b"".join(every[at] for at in sorted(every))


def lines_of(subject: BatchWritable) -> Lines:
    """The lines of those that could be answered, of which there is one at least."""
    places: list[Lists | Cells] = []

    def placed(column: object) -> orjson.Fragment:
        assert isinstance(column, Lists | Cells)
        places.append(column)
        return orjson.Fragment(b"\0")  # JSON has none of its own: in texts it is escaped

    whole = orjson.dumps(subject.answers(), default=placed, option=_OPTIONS)
    return Lines(places, (whole + b"\n").split(b"\0"))
