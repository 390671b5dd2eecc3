"""The head of an answer, written in one go with its body: most of its lines are those of the answer before."""

from __future__ import annotations

from typing import Any

from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, RequestResponseCycle

from service.api.http.answers.head_lines import checked_line, known_line

_LENGTH = b"content-length"
_OF_ONE_ANSWER = frozenset(
    {
        *(_LENGTH, b"etag", b"x-request-id", b"content-range", b"date", b"last-modified"),
        b"inference-header-content-length",
    }
)
_OF_THE_CONNECTION = frozenset({b"connection", b"transfer-encoding"})
_WITHOUT_A_BODY = frozenset({204, 304})
_SMALL_BYTES = 64 << 10  # to copy so much takes less than to write twice


class Cycle(RequestResponseCycle):
    """Uvicorn's, for a connection that stays and an answer that says how long it is; it writes all others itself."""

    _head = b""  # not written yet

    async def send(self, message: ASGISendEvent) -> None:
        """ASGI."""
        if self.flow.write_paused and not self.disconnected:
            await self.flow.drain()
        if self.transport.is_closing():  # a request that was sent ahead, by a client that has left, or was cut off
            self.disconnected = True
        if not self.disconnected:
            if self._end(message) if self.response_started else self._begin(message):
                return
            if self._head:
                self.transport.write(self._head)
        self._head = b""
        await super().send(message)

    @property
    def is_ready(self) -> bool:
        """Whether a whole answer may be written now, and the connection stays."""
        held = self.disconnected or self.flow.write_paused or self.transport.is_closing()
        return self.keep_alive and not held

    def answer(self, status: int, lines: bytes, body: bytes) -> None:
        """Writes a whole answer, of a cycle that `is_ready`. The lines of its head say how long it is."""
        self.response_started, self.waiting_for_100_continue = True, False
        said = b"".join([known_line(*each) for each in self.default_headers])
        self._write(b"%b%b%b\r\n" % (STATUS_LINE[status], said, lines), body)

    def _begin(self, message: Any) -> bool:  # noqa: ANN401 - uvicorn's own, of many kinds
        """Puts the head together if it is such an answer's."""
        if message["type"] != "http.response.start" or not self.keep_alive or self.access_log:
            return False
        status = message["status"]
        lines, length = [STATUS_LINE[status]], 0 if status in _WITHOUT_A_BODY else None
        for name, value in (*self.default_headers, *message["headers"]):
            if name in _OF_THE_CONNECTION:
                return False
            if name in _OF_ONE_ANSWER:
                lines.append(checked_line(name, value))
                if name == _LENGTH:
                    length = int(value)
            else:
                lines.append(known_line(name, value))
        if length is None:
            return False
        self.response_started, self.waiting_for_100_continue = True, False
        self.expected_content_length, self.chunked_encoding = length, False
        lines.append(b"\r\n")
        self._head = b"".join(lines)
        return True

    def _end(self, message: Any) -> bool:  # noqa: ANN401
        """Writes head and body, if that is all of it."""
        head, body = self._head, message.get("body", b"")
        whole = head and len(body) == self.expected_content_length and not message.get("more_body")
        if not whole or message["type"] != "http.response.body" or self.scope["method"] == "HEAD":
            return False
        self._write(head, body)
        return True

    def _write(self, head: bytes, body: bytes) -> None:
        """All there is."""
        if len(body) <= _SMALL_BYTES:
            self.transport.write(head + body)
        else:
            self.transport.write(head)
            self.transport.write(body)
        self._head, self.expected_content_length, self.response_complete = b"", 0, True
        self.message_event.set()
        if not self.keep_alive:
            self.transport.close()
        self.on_response()
