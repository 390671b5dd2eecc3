"""A response whose bytes are there: its headers are put together without looking at each of them anew."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from fastapi import Response
from starlette.types import Receive, Scope, Send

# different with each answer: to remember them is no use
_OWN = frozenset({"ETag", "Content-Range", "Inference-Header-Content-Length"})


class Written(Response):
    """`headers` are all there are, but for `Content-Length`; their names and values are latin-1."""

    def __init__(self, body: bytes, headers: Mapping[str, str], *, status: int = 200) -> None:
        self.status_code = status
        self.background = None
        self.body = body
        self.raw_headers = [
            (name.lower().encode(), value.encode("latin-1")) if name in _OWN else _pair(name, value)
            for name, value in headers.items()
        ]
        if status != 304:
            self.raw_headers.append((b"content-length", b"%d" % len(body)))

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
