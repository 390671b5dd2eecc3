"""Bounds what answers hold in memory until their clients have taken them.

A large body goes to the connection piece by piece, each when the one before it is on its way. The request ends when all
of them are, so what is still to be sent is known. Beyond the limit new requests are refused.

A large answer is not begun before there is room for it: its arrays and its text are several times what a small service
has. Those who ask for one wait for each other (`Room.reserve`), and nobody else does.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Collection

from fastapi import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.limits.worker_threads import ClientGoneError, OverloadedError

TEXT_BYTES = 20
"""Of a number in JSON, with what stands between it and the next."""
_SMALL_BYTES = 256 << 10  # as much may wait for each client without being counted
_PIECE_BYTES = 1 << 20
_LARGE_BYTES = 8 << 20  # others are answered without asking for room
_MOST_WAITING = 32  # each keeps a body of some megabytes
_LONGEST_WAIT_S = 120.0
_ROOM = "service.room"


class WaitingBytes:
    """How much there is of answers that are not on their way yet, and how much of it may be. Of one event loop.

    As much again may be `reserved` for large answers, or whatever the only one of them needs.
    """

    def __init__(self, limit_bytes: int, longest_wait_s: float = _LONGEST_WAIT_S) -> None:
        self.limit_bytes = limit_bytes
        self.count = self.reserved = 0
        self._longest_wait_s = longest_wait_s
        self._line: deque[tuple[int, asyncio.Future[None]]] = deque()

    @property
    def is_full(self) -> bool:
        """Whether the limit is reached."""
        return self.count >= self.limit_bytes

    def require_room(self) -> None:
        """Raises OverloadedError while the limit is reached: nothing more may be made then."""
        if self.is_full:
            raise OverloadedError("answers wait for clients that read slowly; try again in a moment")

    async def reserve(self, size: int) -> None:
        """Returns when there is room for a large answer, first come, first served. Raises OverloadedError."""
        if len(self._line) >= _MOST_WAITING:
            raise OverloadedError("others wait for large answers already; ask for less, or try again in a moment")
        turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._line.append((size, turn))
        self._admit()
        try:
            async with asyncio.timeout(self._longest_wait_s):
                await turn
        except BaseException as error:
            if turn.done() and not turn.cancelled():
                self.release(size)
            self._line = deque(each for each in self._line if each[1] is not turn)
            self._admit()
            if isinstance(error, TimeoutError):
                raise OverloadedError("large answers wait for clients that read slowly; try again later") from None
            raise

    def release(self, size: int) -> None:
        """The answer is on its way, or there is none."""
        self.reserved -= size
        self._admit()

    def _admit(self) -> None:
        while self._line and (not self.reserved or self.reserved + self._line[0][0] <= self.limit_bytes):
            size, turn = self._line.popleft()
            if not turn.done():
                self.reserved += size
                turn.set_result(None)


class Room:
    """What one request has reserved."""

    def __init__(self, waiting: WaitingBytes) -> None:
        self._waiting = waiting
        self.size = 0

    @classmethod
    def of(cls, request: Request) -> Room:
        """That of a request."""
        room: Room = request.scope[_ROOM]
        return room

    async def reserve(self, request: Request, size: int) -> None:
        """Returns when an answer of about `size` bytes may be made. Raises OverloadedError and ClientGoneError."""
        if size < _LARGE_BYTES or self.size:
            return
        await self._waiting.reserve(size)
        self.size = size
        if await request.is_disconnected():
            raise ClientGoneError

    def release(self) -> None:
        """To be called when the request is over."""
        if self.size:
            self._waiting.release(self.size)
            self.size = 0


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
        if self.waiting.is_full and own_path(scope) not in self.always:
            try:
                self.waiting.require_room()
            except OverloadedError as error:
                await self.answer_to(error, own_path(scope))(scope, receive, send)
                return

        scope[_ROOM] = room = Room(self.waiting)

        async def sending(message: Message) -> None:
            body: bytes = message.get("body", b"")
            if len(body) <= _SMALL_BYTES:
                await send(message)
            else:
                await self._in_pieces(message, memoryview(body), send, counted=not room.size)

        try:
            await self.app(scope, receive, sending)
        finally:
            room.release()

    async def _in_pieces(self, message: Message, body: memoryview, send: Send, *, counted: bool) -> None:
        left = len(body) if counted else 0
        self.waiting.count += left
        try:
            for start in range(0, len(body), _PIECE_BYTES):
                piece = body[start : start + _PIECE_BYTES]
                await send({**message, "body": piece, "more_body": True})
                if counted and start:  # the one before it
                    self.waiting.count -= _PIECE_BYTES
                    left -= _PIECE_BYTES
            if not message.get("more_body", False):
                await send({**message, "body": b"", "more_body": False})
        finally:
            self.waiting.count -= left
