"""One log line, one count and one id per request, and the last net for errors: a client always gets an answer."""

from __future__ import annotations

import asyncio
import logging
import random
import re
import time
from collections.abc import Callable, Sequence

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.access.addresses import UNKNOWN, Network, client_address
from service.api.http.answers.head_lines import lines_of
from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.instruments import Instruments
from service.api.http.sent_headers import first_sent
from service.api.http.templates import NO_ROUTE
from service.log import REQUESTS, RequestRecord, request_id

CLIENT = "service.client"
"""Where in its scope a request has the address of the client."""

ANSWERED = "service.answered"
"""Where in its scope a request may have a coroutine function that is told the status before it is sent."""

REQUEST_ID = "X-Request-ID"
_HEADER = REQUEST_ID.lower().encode()
# No page of ours is shown inside another one, and no answer is guessed to be of another kind than it says.
_CAREFUL = ((b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer"))
_CAREFUL_LINES = lines_of(_CAREFUL)
_ID_BITS = 128
_SAFE_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
# asked every few seconds, by machines
QUIET = frozenset({"/health/live", "/health/ready", "/v2/health/live", "/v2/health/ready", "/metrics"})

_WITH_HEADERS = frozenset({"websocket.accept", "websocket.http.response.start"})

_log = logging.getLogger(REQUESTS)


class RequestLog:
    """ASGI middleware, to be the outermost one. Logs the route's template, never the path: that may hold anything.

    Every answer gets the request's id, and headers that tell browsers to be careful.

    `template_of` finds the template for requests that were refused on their way to it.
    """

    def __init__(
        self,
        app: ASGIApp,
        instruments: Instruments,
        answer_to: ErrorAnswers,
        template_of: Callable[[str], str] = lambda _path: NO_ROUTE,
        trusted: Sequence[Network] = (),
    ) -> None:
        self.app = app
        self.answer_to = answer_to
        self.instruments = instruments
        self.template_of = template_of
        self.trusted = trusted

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
        name = id_of(scope)
        status = 0
        scope[CLIENT] = client = client_of(scope.get("client"), scope["headers"], self.trusted)

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                if (tell := scope.get(ANSWERED)) is not None:
                    await tell(status)
                message["headers"] = [*message.get("headers", ()), *own_headers(name)]
            await send(message)

        token = request_id.set(name)
        try:
            await self.app(scope, receive, noting)
        except Exception as error:
            if status:  # half an answer is out already: only cutting the connection tells the client
                raise
            await self.answer_to(error, own_path(scope))(scope, receive, noting)
        finally:
            seconds = time.perf_counter() - began
            # in the next round of the loop: this one first sends what was answered
            asyncio.get_running_loop().call_soon(self._ended, scope, status, seconds, name, client)
            request_id.reset(token)

    def _ended(self, scope: Scope, status: int, seconds: float, name: str, client: str) -> None:
        self.instruments.over()
        write_down(self.instruments, scope["method"], self._route_of(scope), status, seconds, name, client)

    async def _connection(self, scope: Scope, receive: Receive, send: Send) -> None:
        """The line of a connection is written when it is over; its status is the close code that the server sent."""
        began, name, status = time.perf_counter(), id_of(scope), 0
        scope[CLIENT] = client = client_of(scope.get("client"), scope["headers"], self.trusted)

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
            _write("WEBSOCKET", self._route_of(scope), status, time.perf_counter() - began, name, client)
            request_id.reset(token)

    def _route_of(self, scope: Scope) -> str:
        route = getattr(scope.get("route"), "path", None)
        return self.template_of(own_path(scope)) if route is None else route


def client_of(peer: tuple[str, int] | None, headers: Sequence[tuple[bytes, bytes]], trusted: Sequence[Network]) -> str:
    """The address of the client whose request came from `peer` with these headers."""
    if not trusted:
        return peer[0] if peer else UNKNOWN
    forwarded = [value.decode("latin-1") for name, value in headers if name.lower() == b"x-forwarded-for"]
    return client_address(peer[0] if peer else None, forwarded, trusted)


def own_headers(name: str) -> tuple[tuple[bytes, bytes], ...]:
    """What every answer says, that to the request of this id."""
    return *_CAREFUL, (_HEADER, name.encode())


def own_lines(name: str) -> bytes:
    """The same as lines of a head."""
    return b"%bx-request-id: %b\r\n" % (_CAREFUL_LINES, name.encode())


def write_down(
    instruments: Instruments, method: str, route: str, status: int, seconds: float, name: str, client: str
) -> None:
    """The line of a request that was answered, and its counts."""
    _write(method, route, status, seconds, name, client)
    instruments.ended(method, route, status, seconds)


def write_refusal(method: str, status: int, seconds: float, client: str) -> None:
    """The line of a request that was refused before there was one."""
    _write(method, NO_ROUTE, status, seconds, _new_id(), client)


def _write(method: str, route: str, status: int, seconds: float, name: str, client: str) -> None:
    level = logging.DEBUG if route in QUIET else logging.INFO
    if _log.isEnabledFor(level):
        said = {
            "method": method,
            "route": route,
            "status": status,
            "duration_ms": round(seconds * 1000, 2),
            "client": client,
            "request_id": name,
        }
        _log.handle(RequestRecord(level, said))  # by hand: `log` would look for the calling line first


def id_of(scope: Scope) -> str:
    """The id that a request came with, or a new one."""
    sent = first_sent(scope, _HEADER)
    return sent if sent is not None and _SAFE_ID.fullmatch(sent) else _new_id()


def _new_id() -> str:
    """No secret, and so without a call of the system: only no two are to be the same."""
    return f"{random.getrandbits(_ID_BITS):032x}"
