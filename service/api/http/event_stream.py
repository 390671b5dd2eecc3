"""Server-sent events to a bounded number of listeners; the wire format and the heartbeat are sse-starlette's."""

from __future__ import annotations

from collections.abc import AsyncIterator

import anyio
from sse_starlette import EventSourceResponse, ServerSentEvent
from starlette.types import Receive, Scope, Send

from service.api.http.limits.worker_threads import OverloadedError

HEARTBEAT_S = 15.0
MOST_LISTENERS = 32
_STALLED_S = 30.0  # a listener that reads nothing for so long is let go
_RECONNECT_MS = 2000
_LINE_END = "\n"


def server_sent_event(number: int, kind: str, data: str) -> ServerSentEvent:
    """One event; `number` is what a client sends back as `Last-Event-ID`."""
    return ServerSentEvent(data, event=kind, id=str(number), sep=_LINE_END)


def reconnect_after() -> ServerSentEvent:
    """To be sent first: how long a client that lost the connection waits before it comes back."""
    return ServerSentEvent(retry=_RECONNECT_MS, sep=_LINE_END)


class EventStream(EventSourceResponse):
    """Sends `events` as they come and a comment every 15 s; ends with them, with the client or with the server.

    Holds one of `places` while it runs. With none free it raises OverloadedError instead, before anything is sent.
    """

    def __init__(self, events: AsyncIterator[ServerSentEvent], places: anyio.CapacityLimiter) -> None:
        super().__init__(
            events,
            headers={"Cache-Control": "no-store, no-transform"},  # a proxy that compresses would hold events back
            ping=HEARTBEAT_S,
            ping_message_factory=_heartbeat,
            sep=_LINE_END,
            send_timeout=_STALLED_S,
        )
        self._places = places

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        try:
            self._places.acquire_on_behalf_of_nowait(self)
        except anyio.WouldBlock:
            most = round(self._places.total_tokens)
            raise OverloadedError(f"{most} listeners are connected already, which is the limit") from None
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._places.release_on_behalf_of(self)


def _heartbeat() -> ServerSentEvent:
    return ServerSentEvent(comment="still here", sep=_LINE_END)
