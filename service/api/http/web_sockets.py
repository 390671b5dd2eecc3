"""Connections that stay: uvicorn's protocol with a bound on readers that do not read, and who is connected.

A connection has at most one message waiting to be read, one being answered, and one answer on its way out.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Protocol

from uvicorn._types import ASGISendEvent
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

_LINGER_S = 2.0
_log = logging.getLogger(__name__)


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """Uvicorn's, which tells no log which address was asked, and closes a connection that takes nothing all the same.

    Uvicorn waits until the client has read what was sent before it sends that it closes, and then until that is read.
    """

    logger: logging.Logger
    _deaf = False

    def data_received(self, data: bytes) -> None:
        """asyncio's."""
        if not self._deaf:
            super().data_received(data)

    def handle_parser_exception(self) -> None:
        """A message was too long, or no message: says so, and lets what still comes in fall, for a moment.

        To close at once, with the client's bytes unread, resets the connection: it would see that and no reason.
        """
        closing = self.conn.close_sent
        assert closing is not None
        self.queue.put_nowait({"type": "websocket.disconnect", "code": closing.code, "reason": closing.reason})
        self.transport.write(b"".join(self.conn.data_to_send()))
        self.close_sent, self._deaf = True, True
        self.transport.resume_reading()
        self.close_timer = self.loop.call_later(_LINGER_S, self.transport.close)

    async def send(self, message: ASGISendEvent) -> None:
        """ASGI."""
        self.logger = _log  # uvicorn's own lines name the address as it was sent
        if message["type"] == "websocket.close" and not self.writable.is_set():
            self.writable.set()
            self.loop.call_later(_LINGER_S, self.transport.abort)
        await super().send(message)


class Connection(Protocol):
    """One that stays."""

    def end(self) -> None:
        """The server ends: say what there is to say, and close. Called on the event loop."""
        ...


class Connections:
    """Those there are. Only to be used on the event loop."""

    def __init__(self) -> None:
        self._all: set[Connection] = set()
        self._none_left: asyncio.Event | None = None

    def __len__(self) -> int:
        return len(self._all)

    def add(self, connection: Connection) -> None:
        """One that was accepted."""
        self._all.add(connection)

    def remove(self, connection: Connection) -> None:
        """One that is over."""
        self._all.discard(connection)
        if not self._all and self._none_left is not None:
            self._none_left.set()

    async def end(self, patience_s: float) -> None:
        """Ends all of them; those that are not over in time are left to be cut off."""
        if not self._all:
            return
        self._none_left = asyncio.Event()
        for each in list(self._all):
            each.end()
        try:
            await asyncio.wait_for(self._none_left.wait(), patience_s)
        except TimeoutError:
            _log.warning("%d connections were not over after %g s", len(self._all), patience_s)
