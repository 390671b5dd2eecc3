"""Bounds what answers hold in memory until their clients have taken them.

A large body is handed to the connection piece by piece, each when the last one is on its way: so the request lasts as
long as its answer does, and what is still to be sent is known. Beyond the limit new requests are refused.
"""

from __future__ import annotations

from collections.abc import Collection

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.worker_threads import OverloadedError

_PIECE_BYTES = 256 << 10


class AnswerBytes:
    """ASGI middleware. While `limit_bytes` or more wait for slow clients, only the addresses in `always` answer."""

    def __init__(self, app: ASGIApp, limit_bytes: int, answer_to: ErrorAnswers, always: Collection[str] = ()) -> None:
        self.app = app
        self.limit_bytes = limit_bytes
        self.answer_to = answer_to
        self.always = frozenset(always)
        self.waiting_bytes = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if self.waiting_bytes >= self.limit_bytes and own_path(scope) not in self.always:
            error = OverloadedError("answers wait for clients that read slowly; try again in a moment")
            await self.answer_to(error, own_path(scope))(scope, receive, send)
            return

        async def sending(message: Message) -> None:
            body: bytes = message.get("body", b"")
            if len(body) <= _PIECE_BYTES:
                await send(message)
            else:
                await self._in_pieces(message, memoryview(body), send)

        await self.app(scope, receive, sending)

    async def _in_pieces(self, message: Message, body: memoryview, send: Send) -> None:
        self.waiting_bytes += len(body)
        left = len(body)
        try:
            for start in range(0, len(body), _PIECE_BYTES):
                piece = bytes(body[start : start + _PIECE_BYTES])
                last = start + _PIECE_BYTES >= len(body)
                await send({**message, "body": piece, "more_body": message.get("more_body", False) if last else True})
                self.waiting_bytes -= len(piece)
                left -= len(piece)
        finally:
            self.waiting_bytes -= left
