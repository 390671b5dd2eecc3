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


class WaitingBytes:
    """How much there is of answers that are not on their way yet, and how much of it may be. Of one event loop."""

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        self.count = 0

    def require_room(self) -> None:
        """Raises OverloadedError while the limit is reached: nothing more may be made then."""
        if self.count >= self.limit_bytes:
            raise OverloadedError("answers wait for clients that read slowly; try again in a moment")


class AnswerBytes:
    """ASGI middleware. While too much waits for slow clients, only the addresses in `always` answer."""

    def __init__(
        self, app: ASGIApp, waiting: WaitingBytes, answer_to: ErrorAnswers, always: Collection[str] = ()
    ) -> None:
        self.app = app
        self.waiting = waiting
        self.answer_to = answer_to
        self.always = frozenset(always)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        if own_path(scope) not in self.always:
            try:
                self.waiting.require_room()
            except OverloadedError as error:
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
        self.waiting.count += len(body)
        left = len(body)
        try:
            for start in range(0, len(body), _PIECE_BYTES):
                piece = bytes(body[start : start + _PIECE_BYTES])
                last = start + _PIECE_BYTES >= len(body)
                await send({**message, "body": piece, "more_body": message.get("more_body", False) if last else True})
                self.waiting.count -= len(piece)
                left -= len(piece)
        finally:
            self.waiting.count -= left
