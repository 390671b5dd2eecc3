"""A prediction or a drive as a NumPy archive: `numpy.load(file)["x_m"]`."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.lib.format as npy
import numpy.typing as npt

from service.twin.kept import kept
from service.wire.digits import checksum
from service.wire.forms.numbers import dump_finite, require_finite, require_finite_columns
from service.wire.forms.subject import Writable

METADATA = "metadata"

# Of the format's records: `zipfile` has no way to write an array without copying it first. Stored, dated 1980.
_LOCAL, _CENTRAL, _END = struct.Struct("<4s5H3L2H"), struct.Struct("<4s4B4H3L5H2L"), struct.Struct("<4s4H2LH")
_ATTRIBUTES = 0o600 << 16
_UNIX, _NEEDS, _1980 = 3, 20, 33
_MOST_BYTES = (1 << 32) - 1


def encode_npz(subject: Writable) -> bytes:
    """An uncompressed archive with an array of shape (time,) for each column, under its name: float64, or bool.

    `metadata` is a text array without axes: a JSON object with all that is no column, `Writable.about`. The same
    answer gives the same bytes: the archive's members are dated 1980. Raises NonFiniteError.
    """
    columns = subject.columns()
    require_finite_columns(columns, "answer")
    require_finite(subject.scalars(), "answer")
    return archive_of({**columns, METADATA: np.array(dump_finite(subject.about()).decode())})


def archive_of(arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """What `numpy.savez` writes, to the byte what `zipfile` makes of it; each array is copied once, nothing is pickled.

    Raises ValueError for objects, and for 4 GiB and more.
    """
    parts: list[bytes | memoryview] = []
    entries: list[bytes] = []
    at = 0
    for name, values in arrays.items():
        whole = np.asarray(values, order="C")
        header, member = _header(whole.dtype.str, whole.shape), f"{name}.npy".encode()
        size = len(header) + whole.nbytes
        crc = _checksum_of_times(whole) if name == "time_s" else _checksum(whole)
        if at + size > _MOST_BYTES - 4096:
            raise ValueError("an archive of 4 GiB and more")
        parts += [_LOCAL.pack(b"PK\3\4", _NEEDS, 0, 0, 0, _1980, crc, size, size, len(member), 0), member, header]
        parts.append(_bytes_of(whole))
        central = (_NEEDS, _UNIX, _NEEDS, 0, 0, 0, 0, _1980, crc, size, size, len(member), 0, 0, 0, 0, _ATTRIBUTES, at)
        entries += [_CENTRAL.pack(b"PK\1\2", *central), member]
        at += _LOCAL.size + len(member) + size
    directory = b"".join(entries)
    end = _END.pack(b"PK\5\6", 0, 0, len(arrays), len(arrays), len(directory), at, 0)
    return b"".join([*parts, directory, end])


@lru_cache(maxsize=256)
def _header(kind: str, shape: tuple[int, ...]) -> bytes:
    """What `numpy.save` writes before an array. Raises ValueError for objects."""
    dtype = np.dtype(kind)
    if dtype.hasobject:
        raise ValueError("an array of objects cannot be written")
    header = io.BytesIO()
    npy.write_array_header_1_0(header, {"descr": npy.dtype_to_descr(dtype), "fortran_order": False, "shape": shape})
    return header.getvalue()


def _checksum(values: npt.NDArray[Any]) -> int:
    """Of an array with its header."""
    return checksum(values, zlib.crc32(_header(values.dtype.str, values.shape)))


_checksum_of_times = kept(_checksum)


def _bytes_of(values: npt.NDArray[Any]) -> memoryview | bytes:
    """Not copied where the array is one of numbers."""
    return values.data.cast("B") if values.size and values.dtype.kind in "fiub" else values.tobytes()
