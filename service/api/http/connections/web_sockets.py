"""Connections that stay: uvicorn's protocol with a bound on readers that do not read, and who is connected.

A connection has at most two messages waiting to be read, one being answered, and one answer on its way out.

Messages of the common kind (`frames`) are read and written here, for the library takes longer for that than it takes to
answer them. All else is the library's.
"""

from __future__ import annotations

import asyncio
import logging
from typing import Protocol

from uvicorn._types import ASGISendEvent
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.protocol import State
from websockets.streams import StreamReader

from service.api.http.connections.frames import LONGEST_BYTES, framed, whole_message

_LINGER_S = 2.0
_BETWEEN_FRAMES = StreamReader.at_eof.__code__  # where the library's parser waits with nothing of a frame there
_log = logging.getLogger(__name__)


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """Uvicorn's, which tells no log which address was asked, and closes a connection that takes nothing all the same.

    Uvicorn waits until the client has read what was sent before it sends that it closes, and then until that is read.
    """

    logger: logging.Logger
    _deaf = False

    def data_received(self, data: bytes) -> None:
        """asyncio's."""
        if self._deaf:
            return
        message = whole_message(data)
        if message is None or not self._awaits_a_frame() or not self._took(*message):
            super().data_received(data)

    def _awaits_a_frame(self) -> bool:
        """Whether all that the library was given were whole messages, and the connection goes on."""
        conn = self.conn
        if conn.state is not State.OPEN or self.close_sent or conn.current_size is not None or conn.extensions:
            return False
        waits = conn.parser
        while (inner := getattr(waits, "gi_yieldfrom", None)) is not None:
            waits = inner
        return getattr(waits, "gi_code", None) is _BETWEEN_FRAMES and not conn.reader.buffer

    def _took(self, is_text: bool, content: bytes) -> bool:
        """Hands a message on, as uvicorn does; false for text that is none."""
        try:
            self.queue.put_nowait(
                {"type": "websocket.receive", "text": content.decode()}
                if is_text
                else {"type": "websocket.receive", "bytes": content}
            )
        except UnicodeDecodeError:
            return False
        if self.queue.qsize() > 1 and not self.read_paused:  # two system calls, of which one message needs none
            self.read_paused = True
            self.transport.pause_reading()
        return True

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
        if message["type"] == "websocket.send" and self.close_sent:  # an answer to one that answers no pings
            raise ClientDisconnected
        if message["type"] != "websocket.send" or not self._wrote(message.get("bytes"), message.get("text")):
            await super().send(message)

    def _wrote(self, binary: bytes | None, text: str | None) -> bool:
        """Writes a message if it can be written at once."""
        if self.conn.state is not State.OPEN or self.close_sent or not self.writable.is_set() or self.disconnected:
            return False
        content = binary if binary is not None else (text or "").encode()
        if len(content) > LONGEST_BYTES or self.conn.extensions:
            return False
        self.transport.write(framed(content, is_text=binary is None))
        return True


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
