"""Bytes that come out of something packed, counted as they come: a bomb ends at the bound, on disk and in memory."""

from __future__ import annotations

import bz2
import errno
import gzip
import lzma
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from service.datasets.findings import Code, UnusableFileError, reject
from service.datasets.readers.sniff import Kind
from service.datasets.uploads.upload_form import UploadLimits

CHUNK = 1 << 20
# what xz -9 needs; a stream may ask for 4 GiB
_XZ_MEMORY = 80 << 20
BROKEN = (EOFError, OSError, zlib.error, lzma.LZMAError, ValueError)


class Meter:
    """Counts what has come out of `packed_bytes` of one upload. Raises UnusableFileError beyond a limit."""

    def __init__(self, limits: UploadLimits, packed_bytes: int, file: str) -> None:
        self._limits, self._packed, self._file = limits, max(packed_bytes, 1), file
        self._total = self._member = 0

    def next_member(self) -> None:
        """The bytes that follow belong to another file."""
        self._member = 0

    def count(self, size: int, member: str) -> None:
        """So many more bytes came out, or are said to come."""
        self._total += size
        self._member += size
        limits = self._limits
        if self._total > max(limits.ratio * self._packed, limits.ratio_from_bytes):
            message = f"expands to more than {limits.ratio:g} times its {self._packed} bytes: a decompression bomb?"
            raise UnusableFileError([reject(self._file, Code.DECOMPRESSION_BOMB, message)])
        if self._member > limits.file_bytes:
            message = f"more than {limits.file_bytes} bytes once unpacked, allowed is at most that in one file"
            raise UnusableFileError([reject(member, Code.TOO_LARGE, message)])
        if self._total > limits.total_bytes:
            message = f"more than {limits.total_bytes} bytes once unpacked, allowed is at most that"
            raise UnusableFileError([reject(self._file, Code.TOO_LARGE, message)])


def unpack_stream(source: Path, kind: Kind, target: Path, meter: Meter, file: str) -> None:
    """Write what is packed in `source` to `target`. Raises UnusableFileError for broken or oversized content."""
    try:
        with source.open("rb") as packed, target.open("xb") as sink:
            for chunk in _chunks(packed, kind):
                meter.count(len(chunk), file)
                sink.write(chunk)
    except BROKEN as error:
        reraise_system_error(error)
        code = Code.BROKEN_GZIP if kind is Kind.GZIP else Code.BROKEN_ARCHIVE
        message = f"broken {kind} data ({error or type(error).__name__}); upload the file again"
        raise UnusableFileError([reject(file, code, message)]) from error


def reraise_system_error(error: Exception) -> None:
    """A full disk is no fault of the upload. Broken data raises OSError as well: without a number, or EINVAL for a
    place before the file's start.
    """
    if isinstance(error, OSError) and error.errno not in {None, errno.EINVAL}:
        raise error


def _chunks(packed: BinaryIO, kind: Kind) -> Iterator[bytes]:
    if kind is Kind.XZ:
        yield from _xz_chunks(packed)
        return
    with gzip.GzipFile(fileobj=packed) if kind is Kind.GZIP else bz2.BZ2File(packed) as stream:
        while chunk := stream.read(CHUNK):
            yield chunk


def _xz_chunks(packed: BinaryIO) -> Iterator[bytes]:
    """One stream with a bound on its memory, which the library's file object does not have."""
    unpacker = lzma.LZMADecompressor(lzma.FORMAT_XZ, memlimit=_XZ_MEMORY)
    while not unpacker.eof:
        fed = packed.read(CHUNK) if unpacker.needs_input else b""
        if unpacker.needs_input and not fed:
            raise EOFError("it ends before its end mark")
        yield unpacker.decompress(fed, CHUNK)
    if unpacker.unused_data.strip(b"\0") or packed.read(1):
        raise ValueError("something follows its end mark")
