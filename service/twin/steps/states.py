"""States of rovers as bytes that travel: which version they belong to, their numbers, and a checksum.

    magic RTST | format | length of the name | version | name of the model | numbers (float64) | CRC-32 of all before

Little-endian. The checksum catches accidents, not forgery: the engine is safe with any numbers.
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.errors import RoverTwinError
from service.physics.scenario import Array

FORMAT = 1
MOST_BYTES = 4096
_MAGIC = b"RTST"
_HEAD = struct.Struct("<4sHHI")  # magic, format, bytes of the name, version
_CHECKSUM = 4
_AT_ONCE = 128
_NONE = "this is not the state of a rover"


class StateError(RoverTwinError, ValueError):
    """Bytes that are not a state, or not one that can be continued; the message says why."""


@dataclass(frozen=True, slots=True, eq=False)
class StoredStates:
    """States of one version: where each was among those that were read, and their `numbers` (state, ...)."""

    name: str
    version: int
    rows: npt.NDArray[np.intp]
    numbers: Array


def write_states(name: str, version: int, numbers: Array) -> list[bytes]:
    """The bytes of each state; `numbers` are (state, ...)."""
    encoded = name.encode()
    head = _HEAD.pack(_MAGIC, FORMAT, len(encoded), version) + encoded
    size, start = 8 * numbers.shape[1], zlib.crc32(head)
    found = []
    for rows in some_at_once(len(numbers)):
        body = np.ascontiguousarray(numbers[rows], dtype="<f8").tobytes()
        for at in range(0, len(body), size):
            part = body[at : at + size]
            found.append(head + part + zlib.crc32(part, start).to_bytes(_CHECKSUM, "little"))
    return found


def some_at_once(count: int) -> Iterator[slice]:
    """Rows in pieces that fit the processor's caches, and that no allocation takes from the system and gives back."""
    return (slice(first, first + _AT_ONCE) for first in range(0, count, _AT_ONCE))


def read_states(states: Sequence[bytes]) -> tuple[list[StoredStates], dict[int, StateError]]:
    """Those of each version, and by their place what is wrong with the others. Versions may not exist."""
    alike: dict[tuple[bytes, int], list[int]] = defaultdict(list)
    for row, data in enumerate(states):
        alike[data[: _HEAD.size + int.from_bytes(data[6:8], "little")], len(data)].append(row)
    found: list[StoredStates] = []
    wrong: dict[int, StateError] = {}
    for (head, length), rows in alike.items():
        try:
            name, version = _identity(head)
            if length > MOST_BYTES or length < len(head) + _CHECKSUM or (length - len(head) - _CHECKSUM) % 8:
                raise StateError("it is cut off, or something was added to it")  # noqa: TRY301
        except StateError as error:
            wrong |= dict.fromkeys(rows, error)
            continue
        whole = [row for row in rows if _is_whole(states[row])]
        if len(whole) < len(rows):
            altered = StateError("it was altered on its way: its checksum is another one")
            wrong |= dict.fromkeys(set(rows).difference(whole), altered)
        if whole:
            numbers = np.empty((len(whole), (length - len(head) - _CHECKSUM) // 8))
            for part in some_at_once(len(whole)):
                table = np.frombuffer(b"".join([states[row] for row in whole[part]]), np.uint8).reshape(-1, length)
                numbers[part] = np.ascontiguousarray(table[:, len(head) : -_CHECKSUM]).view("<f8")
            found.append(StoredStates(name, version, np.array(whole, dtype=np.intp), numbers))
    return found, wrong


def _identity(head: bytes) -> tuple[str, int]:
    """Name and version in the head of a state. Raises StateError."""
    if len(head) < _HEAD.size or head[:4] != _MAGIC:
        raise StateError(_NONE)
    _, form, length, version = _HEAD.unpack_from(head)
    if form != FORMAT:
        raise StateError(f"it has format {form}, this release reads format {FORMAT}: start anew")
    if len(head) != _HEAD.size + length:
        raise StateError("it is cut off")
    try:
        return head[_HEAD.size :].decode(), version
    except UnicodeDecodeError as error:
        raise StateError("it was altered on its way: it names no model") from error


def _is_whole(state: bytes) -> bool:
    return zlib.crc32(memoryview(state)[:-_CHECKSUM]) == int.from_bytes(state[-_CHECKSUM:], "little")
