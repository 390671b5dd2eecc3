"""Connections that cannot silence the service: heads that are too large or too slow, clients that do not read.

Uvicorn has no setting for these. `GuardedProtocol` is its HTTP protocol with bounds; `Connections` are those of one
process, looked through once a second (`sweep`).
"""

from __future__ import annotations

import asyncio
import fcntl
import logging
import resource
import termios
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from starlette.responses import Response
from uvicorn._types import ASGI3Application
from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle
from uvicorn.server import ServerState

from service.api.http.connections.cycle import Cycle
from service.api.http.connections.turns import EACH_ROUND, Turns
from service.api.http.exceptions import HeadTooLargeError, HeadTooSlowError, MalformedHeadError
from service.api.http.limits.worker_threads import OverloadedError

# These are answered on whatever connection is left: an orchestrator must never take a busy service for a dead one.
HEALTH_PATHS = frozenset({"/health/live", "/health/ready", "/v2/health/live", "/v2/health/ready"})
_SPARE = 64  # connections beyond the limit, for health
_SPARE_FILES = 256  # what is open besides connections
_LINGER_BYTES = 1 << 20
_LINGER_S = 1.0  # after a refusal: closing at once, with bytes unread, would destroy the answer on its way
_MOMENT_S = 0.1
_DRAINED_BYTES = 16 << 10  # less than this within `send_s` is no reading

_REASONS: dict[type[Exception], str] = {
    HeadTooLargeError: "head-too-large",
    HeadTooSlowError: "head-too-slow",
    OverloadedError: "too-many-connections",
}

_log = logging.getLogger(__name__)
Headers = list[tuple[bytes, bytes]]


@dataclass(frozen=True, slots=True)
class ConnectionLimits:
    """`connections` at once; a head has at most `head_bytes` and `head_fields` and comes within `head_s`; a body may
    pause `body_s`; a client that takes nothing of an answer for `send_s` is cut off. Idle connections stay open for
    `linger_s` when the server ends, so that a request on its way is answered.
    """

    connections: int = 2048
    head_bytes: int = 32 << 10
    head_fields: int = 100
    head_s: float = 10.0
    body_s: float = 60.0
    send_s: float = 10.0
    linger_s: float = 1.0


class Connections:
    """All connections of one process. `answer` makes the answer to an error, `refused` counts it by its reason.

    `logged` writes the line of a refused request: its method, status and seconds, where it came from, its headers.
    `at_once` may answer a request without an app: status, lines of the head and body, or None.
    """

    def __init__(
        self,
        limits: ConnectionLimits,
        answer: Callable[[Exception, str], Response],
        refused: Callable[[str], None] = lambda _reason: None,
        logged: Callable[[str, int, float, tuple[str, int] | None, Headers], None] = lambda *_: None,
        at_once: Callable[[Any], tuple[int, bytes, bytes] | None] = lambda _: None,
    ) -> None:
        self.limits = limits
        self.logged, self.at_once = logged, at_once
        self.answer = answer
        self.refused = refused
        self.ending = self.closing = False
        self.open: set[GuardedProtocol] = set()
        self.turns = Turns()
        self.arrived: Callable[[], object] = lambda: None  # called for each connection that uvicorn took in

    def protocol(
        self,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> GuardedProtocol:
        """What uvicorn calls for each connection."""
        self.arrived()
        return GuardedProtocol(self, config, server_state, app_state, _loop)

    def admit(self, newcomer: GuardedProtocol) -> bool:
        """Takes a connection in, in place of the one that has been idle for longest if there are too many.

        False where all are busy: then only health is answered on it.
        """
        self.open.add(newcomer)
        if len(self.open) <= self.limits.connections:
            return True
        idle = [each for each in self.open if each.is_idle and each is not newcomer]
        if idle:
            min(idle, key=lambda each: each.waiting_since).cut("too-many-connections")
            return True
        if len(self.open) > self.limits.connections + _SPARE:
            newcomer.cut("too-many-connections")
        return False

    def announce_end(self) -> None:
        """From here on each answer says that its connection ends with it, so that clients find another server."""
        self.ending = True
        for each in list(self.open):
            each.announce_end()

    def close(self) -> None:
        """No more come in. What is on its way on those that are open is answered, for a moment."""
        self.closing = True
        self.announce_end()

    def sweep(self) -> None:
        """Cuts off who is too slow. To be called about once a second."""
        now = time.monotonic()
        for each in list(self.open):
            each.look(now)


class GuardedProtocol(HttpToolsProtocol):
    """One connection."""

    def __init__(self, connections: Connections, *arguments: Any) -> None:  # noqa: ANN401 - uvicorn's own
        super().__init__(*arguments)
        self.access_log = False  # request_log.py writes it
        self._all = connections
        self._limits = connections.limits
        self._in_head = True
        self._head_bytes = self._head_fields = self._field_bytes = 0
        self._hosts = 0  # headers of this name
        self._refused: Exception | None = None
        self._owed: Exception | None = None  # what is refused once the requests before are answered
        self._lingering = False
        self._admitted = True
        self.waiting_since = self._fed_at = self._read_at = time.monotonic()
        self._unread_bytes = 0
        self._has_begun = False  # one of the requests that came together

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """The client is there."""
        super().connection_made(transport)
        self._admitted = self._all.admit(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """The client is gone, or was cut off."""
        self._all.open.discard(self)
        super().connection_lost(exc)

    def handle_websocket_upgrade(self) -> None:
        """From here on another protocol has the connection, with bounds of its own."""
        self._all.open.discard(self)
        super().handle_websocket_upgrade()

    def data_received(self, data: bytes) -> None:
        """Bytes of requests."""
        if self._lingering:
            self._head_bytes += len(data)
            if self._head_bytes > _LINGER_BYTES:
                self.transport.abort()
            return
        self._fed_at, self._has_begun = time.monotonic(), False
        if self._in_head:
            if not self._head_bytes:
                self.waiting_since = self._fed_at
            self._head_bytes += len(data)
        super().data_received(data)
        if self._in_head and self._head_bytes > self._limits.head_bytes and not self._lingering:
            self._refuse_in_turn(HeadTooLargeError(self._limits.head_bytes, self._limits.head_fields))

    def on_message_begin(self) -> None:
        """Of a request."""
        super().on_message_begin()
        self._in_head, self._head_fields, self._field_bytes, self._hosts = True, 0, 0, 0

    def on_header(self, name: bytes, value: bytes) -> None:
        """Raises HeadTooLargeError, upon which the parser gives up."""
        self._head_fields += 1
        if self._head_fields > self._limits.head_fields:
            self._refused = HeadTooLargeError(self._limits.head_bytes, self._limits.head_fields)
            raise self._refused
        self._field_bytes += len(name) + len(value) + 4
        name = name.lower()
        if name == b"host":
            self._hosts += 1
        elif name == b"expect" and value.lower() == b"100-continue":
            self.expect_100_continue = True
        self.headers.append((name, value))

    def on_headers_complete(self) -> None:
        """Raises HeadTooLargeError, upon which the parser gives up."""
        if len(self.url) + self._field_bytes > self._limits.head_bytes:
            self._refused = HeadTooLargeError(self._limits.head_bytes, self._limits.head_fields)
            raise self._refused
        self._in_head, self._head_bytes = False, 0
        if self._hosts > 1 or (not self._hosts and self.parser.get_http_version() == "1.1"):  # RFC 9112, 3.2
            self._refused = MalformedHeadError(f"the request has {self._hosts or 'no'} Host headers, allowed is one")
            raise self._refused
        if not self._admitted and self.url.partition(b"?")[0].decode("latin-1") not in HEALTH_PATHS:
            self._refused = OverloadedError(f"{self._limits.connections} connections are open and busy")
            raise self._refused
        super().on_headers_complete()
        if self._all.ending and self.cycle is not None:
            self.cycle.keep_alive = False

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
        """What uvicorn calls to begin a request."""
        cycle.__class__ = Cycle  # uvicorn makes its own, wherever it does; ours writes in one go
        few = len(self._all.open) <= EACH_ROUND and not (self._has_begun or self._all.turns)
        self._has_begun = True
        if few or cycle.scope["path"].removeprefix(self.root_path) in HEALTH_PATHS:
            self._begin(cycle, app)
        else:
            self._all.turns.take(partial(self._begin, cycle, app))

    def _begin(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
        if cycle.disconnected:  # while it waited for its turn
            return
        assert isinstance(cycle, Cycle)
        if cycle.is_ready and not self._all.ending and (found := self._all.at_once(cycle.scope)) is not None:
            cycle.answer(*found)
        else:
            super()._start_asgi_task(cycle, app)

    def on_message_complete(self) -> None:
        """Of a request."""
        super().on_message_complete()
        self._in_head, self._head_bytes = True, 0

    def on_response_complete(self) -> None:
        """The next request may come."""
        self.waiting_since = time.monotonic()
        if self.pipeline:
            super().on_response_complete()
        else:  # without its timer for connections that are kept: `look` sees those
            self.server_state.total_requests += 1
            if not self.transport.is_closing():
                self.flow.resume_reading()
                if self._owed is not None:
                    self._refuse(self._owed)
        if self._all.closing:  # its answer was on the way before it could say so
            self.loop.call_later(self._limits.linger_s, self._close_if_idle)

    def send_400_response(self, msg: str) -> None:
        """What uvicorn calls when the parser gave up."""
        self._refuse_in_turn(self._refused or MalformedHeadError(msg))

    def resume_writing(self) -> None:
        """The client has read."""
        self._read_at = time.monotonic()
        super().resume_writing()

    def look(self, now: float) -> None:
        """Cuts the client off if it is too slow."""
        if self.transport is None or self.transport.is_closing():
            return
        unread = self.transport.get_write_buffer_size()
        if not unread or unread < self._unread_bytes - _DRAINED_BYTES or unread > self._unread_bytes:
            self._unread_bytes, self._read_at = unread, now
        elif now - self._read_at > self._limits.send_s:
            self.cut("slow-reader")
            return
        if self._lingering:
            return
        if self.is_idle:
            waited_s, new = now - self.waiting_since, self.cycle is None or self._head_bytes > 0
            if new and waited_s > self._limits.head_s:
                self._refuse(HeadTooSlowError(self._limits.head_s)) if self._head_bytes else self.cut("silent")
            elif not new and waited_s > self.timeout_keep_alive:
                self._close_if_idle()
        elif self.cycle.more_body and not self.flow.read_paused and now - self._fed_at > self._limits.body_s:
            self.cut("slow-body")

    def announce_end(self) -> None:
        """The answer that is being made is the last one. One that is on its way can no longer say so."""
        if not self.is_idle and not self.cycle.response_started:
            self.cycle.keep_alive = False

    def shutdown(self) -> None:
        """The server ends: what is being answered is finished, what comes within a moment is answered too."""
        self.announce_end()
        if self.is_idle:
            self.loop.call_later(self._limits.linger_s, self._close_if_idle)

    def cut(self, reason: str) -> None:
        """Ends the connection at once."""
        self._all.refused(reason)
        _log.info("a connection from %s was cut off: %s", self.client[0] if self.client else "unknown", reason)
        self.transport.abort()

    def _close_if_idle(self) -> None:
        if self.transport is None or self.transport.is_closing() or not self.is_idle:
            return
        if self._has_come():  # to close now would lose it
            self.loop.call_later(_MOMENT_S, self._close_if_idle)
        else:
            self.transport.close()

    def _waited_s(self) -> float:
        return time.monotonic() - self.waiting_since

    def _method(self) -> str:
        """Of the request that is coming in; `?` while it is not known."""
        method: bytes = self.parser.get_method() if self.headers else b""
        return method.decode("ascii", "replace") or "?"

    def _has_come(self) -> bool:
        """Whether there are bytes that were not read yet."""
        count = array("i", [0])
        try:
            fcntl.ioctl(self.transport.get_extra_info("socket").fileno(), termios.FIONREAD, count)
        except OSError:
            return False
        return count[0] > 0

    def _refuse_in_turn(self, error: Exception) -> None:
        """Refuses what cannot be read, after the answers to what was sent before it. Nothing more is read."""
        cycle, before = self.cycle, not self.is_idle
        if cycle is not None and before and cycle.more_body:  # this is it: its head was right, its body is not
            cycle.disconnected = True
            cycle.message_event.set()
            before = bool(self.pipeline) and self.pipeline[0][0] is cycle  # it has not begun, another one has
            if before:
                self.pipeline.popleft()
            elif cycle.response_started:  # too late for another answer
                self.transport.close()
                return
        if before:
            self._owed, self._lingering = error, True
        else:
            self._refuse(error)

    def _refuse(self, error: Exception) -> None:
        """Answers a request of which no head could be made, and hangs up."""
        self._all.refused(_REASONS.get(type(error), "malformed-head"))
        response = self._all.answer(error, "/")
        self._all.logged(self._method(), response.status_code, self._waited_s(), self.client, self.headers or [])
        lines = [b"HTTP/1.1 %d \r\n" % response.status_code, b"connection: close\r\n"]
        lines += [name + b": " + value + b"\r\n" for name, value in response.raw_headers if name != b"connection"]
        self.transport.write(b"".join([*lines, b"\r\n", bytes(response.body)]))
        self._lingering = True
        self._unset_keepalive_if_required()
        self.loop.call_later(_LINGER_S, self.transport.close)


def allow_files(connections: int) -> None:
    """Lets the process open as many files as its connections need, as far as the system allows it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = connections + _SPARE + _SPARE_FILES
    if soft < wanted:
        resource.setrlimit(
            resource.RLIMIT_NOFILE, (wanted if hard == resource.RLIM_INFINITY else min(wanted, hard), hard)
        )
