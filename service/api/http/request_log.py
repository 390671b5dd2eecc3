"""One log line, one count and one id per request, and the last net for errors: a client always gets an answer."""

from __future__ import annotations

import logging
import re
import time
import uuid

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.instruments import Instruments
from service.log import REQUESTS, request_id

REQUEST_ID = "X-Request-ID"
_HEADER = REQUEST_ID.lower().encode()
_SAFE_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
# asked every few seconds, by machines
_QUIET = frozenset({"/health/live", "/health/ready", "/v2/health/live", "/v2/health/ready", "/metrics"})

_WITH_HEADERS = frozenset({"websocket.accept", "websocket.http.response.start"})

_log = logging.getLogger(REQUESTS)


class RequestLog:
    """ASGI middleware, to be the outermost one. Logs the route's template, never the path: that may hold anything."""

    def __init__(self, app: ASGIApp, instruments: Instruments, answer_to: ErrorAnswers) -> None:
        self.app = app
        self.answer_to = answer_to
        self.instruments = instruments

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] == "websocket":
            await self._connection(scope, receive, send)
            return
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began = time.perf_counter()
        self.instruments.begun()
        name = _id_of(scope)
        header = (_HEADER, name.encode())
        status = 0

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message.get("headers", ()), header]
            await send(message)

        token = request_id.set(name)
        try:
            await self.app(scope, receive, noting)
        except Exception as error:
            if status:  # half an answer is out already: only cutting the connection tells the client
                raise
            await self.answer_to(error, own_path(scope))(scope, receive, noting)
        finally:
            route = getattr(scope.get("route"), "path", "no route")
            seconds = time.perf_counter() - began
            _write(scope["method"], route, status, seconds, name)
            self.instruments.ended(scope["method"], route, status, seconds)
            request_id.reset(token)

    async def _connection(self, scope: Scope, receive: Receive, send: Send) -> None:
        """The line of a connection is written when it is over; its status is the close code that the server sent."""
        began, name, status = time.perf_counter(), _id_of(scope), 0

        async def noting(message: Message) -> None:
            nonlocal status
            kind = message["type"]
            if kind != "websocket.send":
                status = message.get("status", message.get("code", status))
                if kind in _WITH_HEADERS:
                    message["headers"] = [*message.get("headers", ()), (_HEADER, name.encode())]
            await send(message)

        token = request_id.set(name)
        try:
            await self.app(scope, receive, noting)
        finally:
            route = getattr(scope.get("route"), "path", "no route")
            _write("WEBSOCKET", route, status, time.perf_counter() - began, name)
            request_id.reset(token)


def _write(method: str, route: str, status: int, seconds: float, name: str) -> None:
    level = logging.DEBUG if route in _QUIET else logging.INFO
    if _log.isEnabledFor(level):
        duration_ms = round(seconds * 1000, 2)
        said = {"method": method, "route": route, "status": status, "duration_ms": duration_ms, "request_id": name}
        # made by hand: `log` looks for the calling line first, which takes as long as all else here
        _log.handle(logging.LogRecord(REQUESTS, level, __file__, 0, said, None, None))


def _id_of(scope: Scope) -> str:
    sent = next((value for header, value in scope["headers"] if header == _HEADER), b"").decode("latin-1")
    return sent if _SAFE_ID.fullmatch(sent) else uuid.uuid4().hex
