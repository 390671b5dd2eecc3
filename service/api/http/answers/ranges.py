"""A part of an answer's bytes: libraries that read tables from an address ask for the end of a Parquet file first."""

from __future__ import annotations

import re
from dataclasses import dataclass

from starlette.types import Scope

from service.api.http.sent_headers import first_sent

_ONE_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})", re.ASCII)
PARTIAL = 206


@dataclass(frozen=True, slots=True)
class Range:
    """What `Range` and `If-Range` of a GET say, as they came."""

    wanted: str = ""
    only_if: str = ""

    @classmethod
    def of(cls, scope: Scope) -> Range:
        """From the headers of a request."""
        wanted = first_sent(scope, b"range")
        return NO_RANGE if wanted is None else cls(wanted, first_sent(scope, b"if-range") or "")

    def part(self, size: int, tag: str) -> slice | None:
        """Which of `size` bytes are wanted; None for all of them.

        What cannot be met is ignored, as HTTP allows: several ranges, one that begins behind the end, or a client that
        has another version of the answer than that of the strong entity `tag`.
        """
        found = _ONE_RANGE.fullmatch(self.wanted.strip())
        if found is None or (self.only_if and self.only_if.strip() != tag):
            return None
        first, last = found.groups()
        if not first:  # the last so many bytes
            return slice(max(0, size - int(last)), size) if last and int(last) and size else None
        start, stop = int(first), min(int(last) + 1, size) if last else size
        return slice(start, stop) if start < stop else None


NO_RANGE = Range()


def content_range(part: slice, size: int) -> str:
    """The header `Content-Range`."""
    return f"bytes {part.start}-{part.stop - 1}/{size}"
