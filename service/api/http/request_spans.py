"""A span for each request, which goes on with the trace that the client's `traceparent` names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service import tracing
from service.api.http.errors import own_path
from service.api.http.request_log import QUIET, REQUEST_ID

if TYPE_CHECKING:
    from opentelemetry.trace import Span

_NAMES = (b"traceparent", b"tracestate")
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_HEADER = REQUEST_ID.lower().encode()
_SERVERS_FAULT = 500


class RequestSpans:
    """ASGI middleware around `RequestLog`, only where spans are made. Named by the route's template, as log lines are.

    What machines ask every few seconds (health, metrics) has none.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        if scope["type"] not in ("http", "websocket") or own_path(scope) in QUIET or not tracing.is_on():
            await self.app(scope, receive, send)
            return
        method = scope.get("method", "WEBSOCKET")
        method = method if method in (*_METHODS, "WEBSOCKET") else "_OTHER"
        came_with = {name.decode(): value.decode("latin-1") for name, value in scope["headers"] if name in _NAMES}
        with tracing.continued(method, came_with, {"http.request.method": method}, serves=True) as span:
            assert span is not None

            async def noting(message: Message) -> None:
                if "status" in message or message["type"] == "websocket.accept":
                    _note_start(span, message)
                await send(message)

            try:
                await self.app(scope, receive, noting)
            finally:
                route = getattr(scope.get("route"), "path", None)
                if route is not None:
                    span.update_name(f"{method} {route}")
                    span.set_attribute("http.route", route)


def _note_start(span: Span, message: Message) -> None:
    from opentelemetry.trace import StatusCode  # noqa: PLC0415 - loaded by now

    status = message.get("status", 101)
    span.set_attribute("http.response.status_code", status)
    if status >= _SERVERS_FAULT:
        span.set_status(StatusCode.ERROR)
    for name, value in message.get("headers", ()):
        if name == _HEADER:
            span.set_attribute("rover_twin.request_id", value.decode("latin-1"))
