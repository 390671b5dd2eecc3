"""Puts the service together, here only: settings -> store -> registry -> app -> server. Importing it does nothing."""

from __future__ import annotations

import gc
import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from functools import partial
from types import FrameType
from typing import Any, NamedTuple

import anyio
import anyio.to_thread
import structlog
import uvicorn
from fastapi import FastAPI
from fastapi.middleware.cors import CORSMiddleware

import service
from model_store import ModelStore
from service import child, parts, tracing
from service.access.addresses import networks
from service.access.tokens import Tokens
from service.api import health, metrics
from service.api.access import Access
from service.api.admin import Gate
from service.api.http import docs
from service.api.http.accepting import Acceptor
from service.api.http.answer_bytes import AnswerBytes, WaitingBytes
from service.api.http.body_limit import BodyLimit
from service.api.http.connection import HEALTH_PATHS, ConnectionLimits, Connections, GuardedProtocol, allow_files
from service.api.http.errors import ErrorAnswers
from service.api.http.instruments import Instruments
from service.api.http.lanes import Lanes, lanes_of
from service.api.http.openapi import openapi_of
from service.api.http.pace import Pace
from service.api.http.request_log import RequestLog, client_of, write_refusal
from service.api.http.request_spans import RequestSpans
from service.api.http.semantics import Semantics
from service.api.http.templates import Templates
from service.api.http.upload_body import remove_forgotten_uploads
from service.api.http.web_sockets import WebSocketProtocol
from service.api.http.worker_threads import WorkerThreads
from service.api.services import Lifecycle, LifespanState, Services
from service.api.v1 import (
    aliases,
    audit,
    batch,
    datasets,
    drive_batch,
    drives,
    fmu,
    live,
    mobility,
    models,
    predictions,
    steps,
    suggested_runs,
    training_jobs,
    version_states,
)
from service.api.v2 import routes as inference
from service.api.v2.failures import PREFIX, failure
from service.cpu import available_cpus, limit_torch_threads
from service.jobs.audit import AuditLog
from service.jobs.queue import JobQueue
from service.jobs.supervisor import WorkerSupervisor
from service.log import configure_logging
from service.memory import give_back, limit_arenas
from service.processes import run_processes
from service.settings import Settings, require_tokens
from service.twin import Twin, TwinRegistry
from service.twin.registry import REFRESH_S, REMOTE_REFRESH_S

_TICKS_OF_A_SECOND = 10
_CLOSE_S = 2.0
_LAST_S = 1.0  # beyond drain and grace, for what a process tidies up
_PARTING_S = 5.0  # in which live connections hand back what they keep
_FOR_FORMS = {PREFIX: failure}
_Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[LifespanState]]

_log = structlog.get_logger(__name__)


def create_app(
    settings: Settings, lifecycle: Lifecycle | None = None, instruments: Instruments | None = None
) -> FastAPI:
    """The service as an ASGI app. Opens the store, loads nothing yet: models are loaded when the app starts.

    An empty store or a default model that cannot be loaded stops nothing: readiness says so until it heals.
    `lifecycle` lets whoever runs the app announce its end, `instruments` count what several processes do. Raises what
    `ModelStore.open` and `tokens_of` raise.
    """
    store = ModelStore.open(settings.store_url, patience_s=settings.store_timeout_s)
    counting, waiting = instruments or Instruments(), WaitingBytes(settings.max_answer_bytes)
    threads = settings.threads or available_cpus()

    def brought_in(twin: Twin) -> None:
        if "torch" in sys.modules:  # imported by the first version that has a network
            limit_torch_threads(threads)
        counting.loaded(twin)

    registry = TwinRegistry(
        store,
        settings.default_model,
        capacity=settings.max_resident_versions,
        refresh_s=settings.refresh_s or (REMOTE_REFRESH_S if store.remote else REFRESH_S),
        loaded=brought_in,
        released=give_back,
    )
    state = lifecycle or Lifecycle()
    access = Access(tokens_of(settings), counting)
    jobs = (
        JobQueue.open(settings.jobs_url(), settings.max_queued_jobs, settings.keep_jobs_days)
        if settings.admin_is_on
        else None
    )
    worker = _worker(settings)

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[LifespanState]:
        pace = Pace(settings.refusals_per_s)
        services = Services(
            settings=settings,
            lifecycle=state,
            store=store,
            registry=registry,
            predictions=WorkerThreads("predictions", threads, settings.max_waiting, waiting.require_room, pace),
            pace=pace,
            instruments=counting,
            access=access,
            jobs=jobs,
            audit=AuditLog(settings.jobs_url(), settings.audit_days) if jobs else None,
        )

        starting: list[anyio.CancelScope] = []
        ended = anyio.Event()

        async def start() -> None:
            starting.append(anyio.CancelScope())
            with starting[0]:  # a store that hangs does not hold the end
                await anyio.to_thread.run_sync(registry.start, abandon_on_cancel=True)
            await anyio.to_thread.run_sync(remove_forgotten_uploads)
            if worker and not ended.is_set():  # only now: what starts must not wait for processor time
                await worker.run()

        async with anyio.create_task_group() as tasks:
            # beside the start, not before it: a slow store must not make the process look dead
            tasks.start_soon(start)
            yield LifespanState(services=services)
            ended.set()
            for scope in starting:
                scope.cancel()
            if worker:
                worker.end()
        registry.close()
        if jobs:
            with anyio.move_on_after(_CLOSE_S):
                await anyio.to_thread.run_sync(jobs.close, abandon_on_cancel=True)

    app = _assemble(lifespan, counting, _Chosen.of(settings), waiting)
    _prepare_routes(app)
    return app


def _worker(settings: Settings) -> WorkerSupervisor | None:
    if not settings.admin_is_on or not settings.start_worker:
        return None
    if not parts.has(parts.TRAINING):
        _log.warning("this installation cannot train, and no worker is started: training jobs wait for one elsewhere")
        return None
    return WorkerSupervisor(settings)


def openapi_document() -> dict[str, Any]:
    """The OpenAPI document, without a store or a server. The same for all settings."""
    usual = {name: Settings.model_fields[name].default for name in _Chosen._fields}
    return openapi_of(_assemble(None, Instruments(), _Chosen(**usual), WaitingBytes(usual["max_answer_bytes"])))


class _Chosen(NamedTuple):
    """The settings of these names."""

    max_body_bytes: int
    max_upload_bytes: int
    max_answer_bytes: int
    cors_origins: tuple[str, ...]
    trusted_proxies: tuple[str, ...]

    @classmethod
    def of(cls, settings: Settings) -> _Chosen:
        return cls(*(getattr(settings, name) for name in cls._fields))


def _assemble(lifespan: _Lifespan | None, instruments: Instruments, chosen: _Chosen, waiting: WaitingBytes) -> FastAPI:
    app = FastAPI(
        title="Rover Twin",
        version=service.__version__,
        summary="Where will the rover go, how sure are we, should it drive?",
        description="Trajectories of a rover on a regolith slope: a closed-form solution plus a learned correction.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        separate_input_output_schemas=False,
    )
    larger = {
        ("POST", datasets.router.prefix): chosen.max_upload_bytes,
        **{("POST", each.PATH): max(each.MAX_BODY_BYTES, chosen.max_body_bytes) for each in (batch, drive_batch)},
        **{("POST", each.PATH): max(each.MAX_BODY_BYTES, chosen.max_body_bytes) for each in (drives, steps)},
    }
    answer_to = ErrorAnswers(_FOR_FORMS)
    templates = Templates()
    # the last one added is the outermost
    lanes = [lane for resource in (predictions, drives, steps, inference) for lane in lanes_of(resource.router)]
    app.add_middleware(Lanes, lanes=lanes, answer_to=answer_to)
    app.add_middleware(BodyLimit, limit_bytes=chosen.max_body_bytes, answer_to=answer_to, larger=larger)
    app.add_middleware(Gate, answer_to=answer_to)
    app.add_middleware(AnswerBytes, waiting=waiting, answer_to=answer_to, always=(*HEALTH_PATHS, "/metrics"))
    app.add_middleware(Semantics)
    if chosen.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=chosen.cors_origins,
            allow_methods=["*"],
            allow_headers=["*"],
            expose_headers=["*"],
        )
    app.add_middleware(
        RequestLog,
        instruments=instruments,
        answer_to=answer_to,
        template_of=templates.of,
        trusted=networks(chosen.trusted_proxies),
    )
    if tracing.is_on():
        app.add_middleware(RequestSpans)
    answer_to.install(app)
    app.include_router(predictions.router)  # first, for a request is compared with one address after the other
    app.include_router(batch.router)
    app.include_router(drives.router)
    app.include_router(steps.router)
    app.include_router(drive_batch.router)
    docs.install(app)
    for resource in (inference, mobility, models, fmu, suggested_runs, health, metrics, datasets, training_jobs, audit):
        app.include_router(resource.router)
    for router in (aliases.reading, aliases.moving, version_states.reading, version_states.changing):
        app.include_router(router)
    app.router.routes += live.routes
    templates.learn(app.router.routes)
    app.openapi = lambda: openapi_of(app)  # type: ignore[method-assign] # FastAPI's documented way
    return app


def _prepare_routes(app: FastAPI) -> None:
    """Let FastAPI put its routers together now, a tenth of a second in all, and not while the first request waits."""
    nowhere = {"type": "http", "method": "GET", "path": "/nowhere", "root_path": "", "headers": []}
    for route in app.router.routes:
        route.matches(nowhere)


class Server(uvicorn.Server):
    """Uvicorn, which on SIGTERM first lets readiness answer 503 for `drain_s`, then stops taking requests.

    A load balancer needs that time to see it. Until then all are answered, and told that their connection ends: one
    that is closed unannounced fails the request that is on its way. SIGINT (Ctrl+C), or a second signal, ends without
    it.
    """

    def __init__(self, config: uvicorn.Config, lifecycle: Lifecycle, drain_s: float, connections: Connections) -> None:
        super().__init__(config)
        self._connections = connections
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
        self._acceptor.take(self.config.backlog)  # whom the system let in is answered, and not reset
        await self._acceptor.settle()
        self._acceptor.close()
        await super().shutdown(sockets)

    async def on_tick(self, counter: int) -> bool:
        """Called ten times a second; true ends the serving."""
        if counter % _TICKS_OF_A_SECOND == 0:
            self._connections.sweep()
        if self._lifecycle.draining and not self._connections.ending:
            self._connections.announce_end()
        if not self.should_exit and self._ends_at is not None and time.monotonic() >= self._ends_at:
            self.handle_exit(signal.SIGTERM, None)
        return await super().on_tick(counter)


def run_server(settings: Settings) -> None:
    """Serve until a signal comes; running requests then get `shutdown_grace_s` to finish.

    Raises what `create_app` and `require_tokens` raise, and SystemExit when the address cannot be listened on.
    """
    child.reset_signals()
    require_tokens(settings)
    if settings.workers > 1:
        run_processes(settings)
    else:
        _serve(settings)


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
    server = make_server(create_app(settings, lifecycle, counting), settings, lifecycle, counting)
    gc.collect()
    server.ends_process = True
    gc.freeze()  # modules and routes stay for good: no collection need look through them while requests wait
    try:
        server.run(sockets)
    finally:
        tracing.end()


def tokens_of(settings: Settings) -> Tokens:
    """The tokens in force. Raises TokenFileError for a file that cannot be used."""
    own = settings.admin_token
    return Tokens(own.get_secret_value() if own else None, settings.tokens_file)


def make_server(app: FastAPI, settings: Settings, lifecycle: Lifecycle, instruments: Instruments) -> Server:
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
        ErrorAnswers(_FOR_FORMS),
        instruments.refused,
        lambda method, status, seconds, peer, headers: write_refusal(
            method, status, seconds, client_of(peer, headers, trusted)
        ),
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
