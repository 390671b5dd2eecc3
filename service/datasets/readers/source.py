"""Bytes of a file, plain or gzipped, within a bound: a decompression bomb stops at the bound."""

from __future__ import annotations

import gzip
import io
import zlib
from pathlib import Path
from typing import BinaryIO

from service.datasets.findings import Code, UnusableFileError, reject

DEFAULT_MAX_BYTES = 256 * 1024 * 1024
_GZIP_MAGIC = b"\x1f\x8b"


def read_start(path: Path, size: int) -> bytes:
    """The first `size` bytes of a file's content, plain or gzipped. Raises UnusableFileError for broken gzip."""
    with path.open("rb") as stream:
        if stream.read(2) != _GZIP_MAGIC:
            stream.seek(0)
            return stream.read(size)
        stream.seek(0)
        try:
            with gzip.GzipFile(fileobj=stream) as unpacked:
                return unpacked.read(size)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise UnusableFileError([reject(path.name, Code.BROKEN_GZIP, f"broken gzip data ({error})")]) from error


def read_bounded(stream: BinaryIO, *, file: str = "file", max_bytes: int = DEFAULT_MAX_BYTES) -> bytes:
    """The decompressed content of `stream`; gzip is seen by its magic, not by a name.

    Raises UnusableFileError for more than `max_bytes` (before or after decompression) and for broken gzip.
    """
    raw = stream.read(max_bytes + 1)
    if raw.startswith(_GZIP_MAGIC) and len(raw) <= max_bytes:
        try:
            with gzip.GzipFile(fileobj=io.BytesIO(raw)) as unpacked:
                raw = unpacked.read(max_bytes + 1)
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            message = f"broken gzip data ({error}); upload the file again"
            raise UnusableFileError([reject(file, Code.BROKEN_GZIP, message)]) from error
    if len(raw) > max_bytes:
        message = f"more than {max_bytes} bytes once decompressed, allowed is at most {max_bytes}"
        raise UnusableFileError([reject(file, Code.TOO_LARGE, message)])
    return raw
