"""A response whose bytes are there: its headers are put together without looking at each of them anew."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache

from fastapi import Response
from starlette.types import Receive, Scope, Send

from service.api.http.answers.head_lines import Pair, checked_line, known_lines

_NOT_MODIFIED = 304
# different with each answer: to remember them is no use
_OWN = ("ETag", "Content-Range", "Inference-Header-Content-Length")


class Written(Response):
    """`headers` are all there are, but for `Content-Length`; their names and values are latin-1."""

    def __init__(self, body: bytes, headers: Mapping[str, str], *, status: int = 200) -> None:
        self.status_code = status
        self.background = None
        self.body = body
        self._named = headers

    @cached_property
    def raw_headers(self) -> list[Pair]:  # type: ignore[override]
        """As ASGI wants them."""
        pairs = [
            (name.lower().encode(), value.encode("latin-1")) if name in _OWN else _pair(name, value)
            for name, value in self._named.items()
        ]
        return pairs if self.status_code == _NOT_MODIFIED else [*pairs, (b"content-length", b"%d" % len(self.body))]

    def lines(self) -> bytes:
        """As lines of a head."""
        known, own = dict(self._named), b""
        for name in _OWN:
            if (value := known.pop(name, None)) is not None:
                own += checked_line(name.encode(), value.encode("latin-1"))
        if self.status_code != _NOT_MODIFIED:
            own += b"content-length: %d\r\n" % len(self.body)
        return known_lines(tuple(known.items())) + own

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG002 - as ASGI wants
        """ASGI."""
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        await send({"type": "http.response.body", "body": self.body})


@lru_cache(maxsize=64)
def content_type(media_type: str) -> str:
    """`Content-Type` of a media type: all text is UTF-8."""
    return f"{media_type}; charset=utf-8" if media_type.startswith("text/") else media_type


@lru_cache(maxsize=512)
def _pair(name: str, value: str) -> tuple[bytes, bytes]:
    return name.lower().encode(), value.encode("latin-1")
