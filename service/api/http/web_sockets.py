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
