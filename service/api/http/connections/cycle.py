"""The head of an answer, written in one go: most of its lines are those of the answer before."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.httptools_impl import HEADER_RE, HEADER_VALUE_RE, STATUS_LINE, RequestResponseCycle

_LENGTH = b"content-length"
_OF_ONE_ANSWER = frozenset({_LENGTH, b"etag", b"x-request-id", b"content-range", b"date", b"last-modified"})
_OF_THE_CONNECTION = frozenset({b"connection", b"transfer-encoding"})


class Cycle(RequestResponseCycle):
    """Uvicorn's, for a connection that stays and an answer that says how long it is; it writes all others itself."""

    async def send(self, message: ASGISendEvent) -> None:
        """ASGI."""
        if self.response_started or self.disconnected or self.flow.write_paused or not self._begin(message):
            await super().send(message)

    def _begin(self, message: Any) -> bool:  # noqa: ANN401 - uvicorn's own, of many kinds
        """Writes the head if it is such an answer's."""
        if message["type"] != "http.response.start" or not self.keep_alive or self.access_log:
            return False
        lines, length = [STATUS_LINE[message["status"]]], None
        for name, value in (*self.default_headers, *message["headers"]):
            if name in _OF_THE_CONNECTION:
                return False
            if name in _OF_ONE_ANSWER:
                lines.append(_checked(name, value))
                if name == _LENGTH:
                    length = int(value)
            else:
                lines.append(_line(name, value))
        if length is None:
            return False
        self.response_started, self.waiting_for_100_continue = True, False
        self.expected_content_length, self.chunked_encoding = length, False
        lines.append(b"\r\n")
        self.transport.write(b"".join(lines))
        return True


def _checked(name: bytes, value: bytes) -> bytes:
    if HEADER_RE.search(name):
        raise RuntimeError("Invalid HTTP header name.")
    if HEADER_VALUE_RE.search(value):
        raise RuntimeError("Invalid HTTP header value.")
    return b"%b: %b\r\n" % (name.lower(), value)


_line = lru_cache(maxsize=512)(_checked)
