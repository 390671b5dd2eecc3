"""Runs the service: a server with bounds, which ends in good order and gives up what hangs. Importing does nothing."""

from __future__ import annotations

import json
import os
import signal
import socket
import threading
import time
from functools import partial
from types import FrameType

import structlog
import uvicorn

from service import child, tracing
from service.access.addresses import networks
from service.api.http.application import Application
from service.api.http.connections.accepting import Acceptor
from service.api.http.connections.connection import ConnectionLimits, Connections, GuardedProtocol, allow_files
from service.api.http.connections.web_sockets import WebSocketProtocol
from service.api.http.instruments import Instruments
from service.api.http.request_log import client_of, write_refusal
from service.api.services import Lifecycle
from service.api.v1 import live
from service.app import create_app, error_answers
from service.errors import MissingPartError
from service.learning.drive.library import library as engine
from service.log import configure_logging
from service.memory import Excess, limit_arenas, settle, uncollected
from service.processes import run_processes
from service.settings import Settings, require_tokens
from service.wire.digits import library as digits

_TICKS_OF_A_SECOND = 10
_TICKS_BETWEEN_LOOKS = 100  # at memory
_LAST_S = 1.0  # beyond drain and grace, for what a process tidies up
_PARTING_S = 5.0  # in which live connections hand back what they keep

_log = structlog.get_logger(__name__)


class Server(uvicorn.Server):
    """Uvicorn, which on SIGTERM first lets readiness answer 503 for `drain_s`, then stops taking requests.

    A load balancer needs that time to see it. Until then all are answered, and told that their connection ends: one
    that is closed unannounced fails the request that is on its way. SIGINT (Ctrl+C), or a second signal, ends without
    it.
    """

    def __init__(self, config: uvicorn.Config, lifecycle: Lifecycle, drain_s: float, connections: Connections) -> None:
        super().__init__(config)
        self._connections = connections
        self._excess = Excess()
        self._lifecycle = lifecycle
        self._drain_s = drain_s
        self._ends_at: float | None = None
        self.ends_process = False

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """The signal handler."""
        first = not self._lifecycle.draining
        self._lifecycle.draining = True
        if first and self.ends_process:
            self._end_at_the_latest(sig)
        if first and sig == signal.SIGTERM and self._drain_s > 0:
            self._ends_at = time.monotonic() + self._drain_s
        else:
            super().handle_exit(sig, frame)

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts the app, and listens."""
        await super().startup(sockets)
        state = self.lifespan.state
        protocol = partial(GuardedProtocol, self._connections, self.config, self.server_state, state)
        doors = [each.fileno() for server in self.servers for each in server.sockets]
        self._acceptor = Acceptor(doors, protocol)
        self._connections.arrived = self._acceptor.take

    def _end_at_the_latest(self, sig: int) -> None:
        """Threads that hang in a store or a database hold no end."""
        drain_s = self._drain_s if sig == signal.SIGTERM else 0.0
        grace_s = float(self.config.timeout_graceful_shutdown or 0)
        end = threading.Timer(drain_s + grace_s + _LAST_S, self._give_up)
        end.daemon = True
        end.start()

    def _give_up(self) -> None:
        _log.error("something did not end in time; the process ends without it")
        os._exit(1)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """No new requests from here on: streams end, live connections hand back what they keep, all others finish."""
        self._lifecycle.ending = True
        self._connections.close()
        await self._lifecycle.live.end(min(_PARTING_S, float(self.config.timeout_graceful_shutdown or _PARTING_S)))
        self._acceptor.take_last(self.config.backlog)  # whom the system let in is answered, and not reset
        for door in (*self.servers, *(sockets or ())):  # at once: who came meanwhile would be reset
            door.close()
        await self._acceptor.settle()
        await super().shutdown(sockets)

    async def on_tick(self, counter: int) -> bool:
        """Called ten times a second; true ends the serving."""
        if counter % _TICKS_OF_A_SECOND == 0:
            self._connections.sweep()
        if counter % _TICKS_BETWEEN_LOOKS == 0:
            self._excess.look()
        if self._lifecycle.draining and not self._connections.ending:
            self._connections.announce_end()
        if not self.should_exit and self._ends_at is not None and time.monotonic() >= self._ends_at:
            self.handle_exit(signal.SIGTERM, None)
        return await super().on_tick(counter)


def run_server(settings: Settings) -> None:
    """Serve until a signal comes; running requests then get `shutdown_grace_s` to finish.

    Raises what `create_app` and `require_tokens` raise, MissingPartError where a compiled library is missing or of
    other sources, and SystemExit when the address cannot be listened on.
    """
    child.reset_signals()
    require_tokens(settings)
    _require_libraries()
    if settings.workers > 1:
        run_processes(settings)
    else:
        _serve(settings)


def _require_libraries() -> None:
    """Found out now, not by the first request: a service that is ready answers."""
    try:
        engine()
        digits()
    except ImportError as error:
        raise MissingPartError(str(error)) from error


def run_process() -> None:
    """Be one of several server processes (`service.processes`), on a socket that listens already."""
    given = json.loads(child.given_task())
    settings = Settings.model_validate(given["settings"])
    with socket.socket(fileno=given["listener"]) as listener:
        _serve(settings, Instruments.shared(given["folder"], given["index"]), [listener])


def _serve(
    settings: Settings, instruments: Instruments | None = None, sockets: list[socket.socket] | None = None
) -> None:
    limit_arenas()
    configure_logging(settings.log_level, settings.log_format)
    tracing.begin(settings, "server")
    lifecycle = Lifecycle()
    counting = instruments or Instruments()
    allow_files(settings.max_connections)
    with uncollected():
        server = make_server(create_app(settings, lifecycle, counting), settings, lifecycle, counting)
    server.ends_process = True
    settle()
    try:
        server.run(sockets)
    finally:
        tracing.end()


def make_server(app: Application, settings: Settings, lifecycle: Lifecycle, instruments: Instruments) -> Server:
    """A server that is bounded and quiet. `request_log` reads what proxies say, so uvicorn does not."""
    limits = ConnectionLimits(
        connections=settings.max_connections,
        head_bytes=settings.max_head_bytes,
        head_fields=settings.max_headers,
        head_s=settings.head_timeout_s,
        send_s=settings.send_timeout_s,
    )
    trusted = networks(settings.trusted_proxies)
    connections = Connections(
        limits,
        error_answers(),
        instruments.refused,
        lambda method, status, seconds, peer, headers: write_refusal(
            method, status, seconds, client_of(peer, headers, trusted)
        ),
        at_once=app.at_once.answer if app.at_once is not None else lambda _: None,
    )
    config = uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        root_path=settings.root_path,
        loop="uvloop",
        http=connections.protocol,  # type: ignore[arg-type] # called as the class would be
        ws=WebSocketProtocol,
        ws_max_size=live.MAX_MESSAGE_BYTES,
        ws_per_message_deflate=False,  # answers are small, and wanted at once
        lifespan="on",
        log_config=None,  # log.py has configured it
        access_log=False,  # request_log.py writes it
        server_header=False,
        proxy_headers=False,
        timeout_keep_alive=settings.keep_alive_s,
        timeout_graceful_shutdown=settings.shutdown_grace_s,
    )
    return Server(config, lifecycle, settings.drain_s, connections)
