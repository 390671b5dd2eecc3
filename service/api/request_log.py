"""One log line, one count and one id per request, and the last net for errors: a client always gets an answer."""

from __future__ import annotations

import re
import time
import uuid

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.errors import answer_to
from service.api.instruments import Instruments

REQUEST_ID = "X-Request-ID"
_SAFE_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
# asked every few seconds, by machines
_QUIET = frozenset({"/health/live", "/health/ready", "/v2/health/live", "/v2/health/ready", "/metrics"})

_log = structlog.get_logger("service.requests")


class RequestLog:
    """ASGI middleware, to be the outermost one. Logs the route's template, never the path: that may hold anything."""

    def __init__(self, app: ASGIApp, instruments: Instruments) -> None:
        self.app = app
        self.instruments = instruments

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        began = time.perf_counter()
        self.instruments.begun()
        request_id = _id_of(scope)
        status = 0

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)[REQUEST_ID] = request_id
            await send(message)

        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self.app(scope, receive, noting)
            except Exception as error:
                if status:  # half an answer is out already: only cutting the connection tells the client
                    raise
                await answer_to(error, scope["path"])(scope, receive, noting)
            finally:
                route = getattr(scope.get("route"), "path", "no route")
                seconds = time.perf_counter() - began
                _write(scope["method"], route, status, seconds)
                self.instruments.ended(scope["method"], route, status, seconds)


def _write(method: str, route: str, status: int, seconds: float) -> None:
    write = _log.debug if route in _QUIET else _log.info
    write("request", method=method, route=route, status=status, duration_ms=round(seconds * 1000, 2))


def _id_of(scope: Scope) -> str:
    sent = Headers(scope=scope).get(REQUEST_ID, "")
    return sent if _SAFE_ID.fullmatch(sent) else uuid.uuid4().hex
