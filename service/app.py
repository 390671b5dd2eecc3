"""Puts the service together, here only: settings -> store -> registry -> app -> server. Importing it does nothing."""

from __future__ import annotations

import signal
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from types import FrameType
from typing import Any

import anyio
import anyio.to_thread
import structlog
import uvicorn
from fastapi import FastAPI

import service
from model_store import ModelStore
from service.api import docs, errors, health, mobility, models, predictions, suggested_runs
from service.api.body_limit import BodyLimit
from service.api.execution import Line
from service.api.openapi import document_of
from service.api.request_log import RequestLog
from service.api.services import Lifecycle, LifespanState, Services
from service.cpu import available_cpus, limit_torch_threads
from service.log import configure_logging
from service.settings import Settings
from service.twin import TwinRegistry

_STORAGE_THREADS = 16
_MAX_HEADER_BYTES = 32 * 1024
_Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[LifespanState]]

_log = structlog.get_logger(__name__)


def create_app(settings: Settings, lifecycle: Lifecycle | None = None) -> FastAPI:
    """The service as an ASGI app. Opens the store, loads nothing yet: models are loaded when the app starts.

    An empty store or a default model that cannot be loaded stops nothing: readiness says so until it heals.
    `lifecycle` lets whoever runs the app announce its end. Raises what `ModelStore.open` raises.
    """
    store = ModelStore.open(settings.store_url)
    registry = TwinRegistry(
        store, settings.default_model, capacity=settings.max_resident_versions, refresh_s=settings.refresh_s
    )
    state = lifecycle or Lifecycle()

    @asynccontextmanager
    async def lifespan(_app: FastAPI) -> AsyncIterator[LifespanState]:
        threads = settings.threads or available_cpus()
        limit_torch_threads(threads)
        parts = Services(
            settings=settings,
            lifecycle=state,
            store=store,
            registry=registry,
            predictions=Line("predictions", threads, settings.max_waiting),
            storage=Line("store reads", _STORAGE_THREADS, settings.max_waiting),
        )
        async with anyio.create_task_group() as tasks:
            # beside the start, not before it: a slow store must not make the process look dead
            tasks.start_soon(anyio.to_thread.run_sync, registry.start)
            yield LifespanState(services=parts)
        await anyio.to_thread.run_sync(registry.close)

    return _assemble(lifespan, settings.max_body_bytes)


def openapi_document() -> dict[str, Any]:
    """The OpenAPI document, without a store or a server. The same for all settings."""
    return document_of(_assemble(None, Settings.model_fields["max_body_bytes"].default))


def _assemble(lifespan: _Lifespan | None, max_body_bytes: int) -> FastAPI:
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
    app.add_middleware(BodyLimit, limit_bytes=max_body_bytes)
    app.add_middleware(RequestLog)  # added last, so outermost
    errors.install(app)
    docs.install(app)
    for resource in (predictions, mobility, models, suggested_runs, health):
        app.include_router(resource.router)
    app.openapi = lambda: document_of(app)  # type: ignore[method-assign] # FastAPI's documented way
    return app


class Server(uvicorn.Server):
    """Uvicorn, which on SIGTERM first lets readiness answer 503 for `drain_s`, then stops taking requests.

    A load balancer needs that time to see it. SIGINT (Ctrl+C), or a second signal, ends without it.
    """

    def __init__(self, config: uvicorn.Config, lifecycle: Lifecycle, drain_s: float) -> None:
        super().__init__(config)
        self._lifecycle = lifecycle
        self._drain_s = drain_s
        self._ends_at: float | None = None

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """The signal handler."""
        first = not self._lifecycle.draining
        self._lifecycle.draining = True
        if first and sig == signal.SIGTERM and self._drain_s > 0:
            self._ends_at = time.monotonic() + self._drain_s
        else:
            super().handle_exit(sig, frame)

    async def on_tick(self, counter: int) -> bool:
        """Called ten times a second; true ends the serving."""
        if not self.should_exit and self._ends_at is not None and time.monotonic() >= self._ends_at:
            self.handle_exit(signal.SIGTERM, None)
        return await super().on_tick(counter)


def run_server(settings: Settings) -> None:
    """Serve until a signal comes; running requests then get `shutdown_grace_s` to finish.

    Raises what `create_app` raises, and SystemExit when the address cannot be listened on.
    """
    configure_logging(settings.log_level, settings.log_format)
    lifecycle = Lifecycle()
    Server(server_config(create_app(settings, lifecycle), settings), lifecycle, settings.drain_s).run()


def server_config(app: FastAPI, settings: Settings) -> uvicorn.Config:
    """How uvicorn runs the app: bounded, quiet, trusting no proxy header."""
    return uvicorn.Config(
        app,
        host=settings.host,
        port=settings.port,
        ws="none",
        lifespan="on",
        log_config=None,  # log.py has configured it
        access_log=False,  # request_log.py writes it
        server_header=False,
        proxy_headers=False,
        limit_concurrency=settings.max_connections,
        timeout_graceful_shutdown=settings.shutdown_grace_s,
        h11_max_incomplete_event_size=_MAX_HEADER_BYTES,
    )
