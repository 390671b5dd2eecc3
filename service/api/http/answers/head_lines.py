"""The lines of a head: most of them are those of the answer before, and are kept."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from uvicorn.protocols.http.httptools_impl import HEADER_RE, HEADER_VALUE_RE

Pair = tuple[bytes, bytes]


def checked_line(name: bytes, value: bytes) -> bytes:
    """The line of a header. Raises RuntimeError, in uvicorn's words, for what would not stay one header."""
    if HEADER_RE.search(name):
        raise RuntimeError("Invalid HTTP header name.")
    if HEADER_VALUE_RE.search(value):
        raise RuntimeError("Invalid HTTP header value.")
    return b"%b: %b\r\n" % (name.lower(), value)


known_line = lru_cache(maxsize=512)(checked_line)


def lines_of(headers: Iterable[Pair]) -> bytes:
    """The lines of headers that are different each time."""
    return b"".join([checked_line(name, value) for name, value in headers])


@lru_cache(maxsize=512)
def known_lines(headers: tuple[tuple[str, str], ...]) -> bytes:
    """The lines of headers that come together again and again; their names and values are latin-1."""
    return lines_of((name.encode("latin-1"), value.encode("latin-1")) for name, value in headers)
