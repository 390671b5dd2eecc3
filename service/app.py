"""Puts the service together, here only: settings -> store -> registry -> app. Importing it does nothing."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, NamedTuple

import anyio
import anyio.to_thread
import structlog
from fastapi import FastAPI
from fastapi.middleware.cors import CORSMiddleware

import service
from model_store import ModelStore
from service import parts, tracing
from service.access.addresses import networks
from service.access.failed_logins import FailedLogins
from service.access.tokens import Tokens
from service.api import health, metrics, page
from service.api.access import Access
from service.api.admin import Gate
from service.api.http import docs
from service.api.http.application import Application
from service.api.http.at_once import AnswersAtOnce
from service.api.http.connections.connection import HEALTH_PATHS
from service.api.http.errors import ErrorAnswers
from service.api.http.instruments import Instruments
from service.api.http.lanes import Lanes, lanes_of
from service.api.http.limits.answer_bytes import AnswerBytes, WaitingBytes
from service.api.http.limits.body_limit import BodyLimit
from service.api.http.limits.pace import Pace
from service.api.http.limits.worker_threads import WorkerThreads
from service.api.http.openapi import openapi_of, operation_id
from service.api.http.request_log import RequestLog
from service.api.http.request_spans import RequestSpans
from service.api.http.semantics import Semantics
from service.api.http.templates import Templates
from service.api.http.upload_body import remove_forgotten_uploads
from service.api.services import Lifecycle, LifespanState, Services
from service.api.v1 import (
    batch,
    drive_batch,
    drives,
    fmu,
    live,
    mobility,
    models,
    predictions,
    steps,
    suggested_runs,
    version_pages,
)
from service.api.v1.admin import aliases, audit, datasets, training_jobs, version_states
from service.api.v2 import routes as inference
from service.api.v2.failures import PREFIX, failure
from service.cpu import available_cpus, limit_blas_threads
from service.jobs.audit import AuditLog
from service.jobs.queue import JobQueue
from service.jobs.supervisor import WorkerSupervisor
from service.learning.drive.threads import allow_threads
from service.memory import give_back
from service.settings import Settings
from service.twin import Twin, TwinRegistry
from service.twin.registry import REFRESH_S, REMOTE_REFRESH_S

_CLOSE_S = 2.0
# A request is compared with one address after the other: first those that many ask for.
_ROUTERS = (
    *(each.router for each in (predictions, batch, drives, steps, drive_batch, page)),
    *(each.router for each in (inference, mobility, models, version_pages, fmu, suggested_runs, health, metrics)),
    *(each.router for each in (datasets, training_jobs, audit)),
    *(aliases.reading, aliases.moving, version_states.reading, version_states.changing),
)
_Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[LifespanState]]

_log = structlog.get_logger(__name__)


def create_app(
    settings: Settings, lifecycle: Lifecycle | None = None, instruments: Instruments | None = None
) -> Application:
    """The service as an ASGI app. Opens the store, loads nothing yet: models are loaded when the app starts.

    An empty store or a default model that cannot be loaded stops nothing: readiness says so until it heals.
    `lifecycle` lets whoever runs the app announce its end, `instruments` count what several processes do. Raises what
    `ModelStore.open` and `tokens_of` raise.
    """
    store = ModelStore.open(settings.store_url, patience_s=settings.store_timeout_s)
    counting, waiting = instruments or Instruments(), WaitingBytes(settings.max_answer_bytes)
    threads = settings.threads or available_cpus()
    allow_threads(threads)

    def brought_in(twin: Twin) -> None:
        if not twin.model.quick:  # a network: its products are so small that a second thread only makes them wait
            limit_blas_threads(1)
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
    access = Access(tokens_of(settings), counting, _failed_logins(settings))
    jobs = (
        JobQueue.open(settings.jobs_url(), settings.max_queued_jobs, settings.keep_jobs_days, settings.jobs_timeout_s)
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
            audit=AuditLog(settings.jobs_url(), settings.audit_days, settings.jobs_timeout_s) if jobs else None,
        )
        async with _running(services, worker):
            yield LifespanState(services=services)

    return _assemble(lifespan, counting, _Chosen.of(settings), waiting)


@asynccontextmanager
async def _running(services: Services, worker: WorkerSupervisor | None) -> AsyncIterator[None]:
    """What goes on beside the requests, for as long as the service is up: aliases are followed, tokens read again."""
    starting = anyio.CancelScope()

    async def start() -> None:
        with starting:  # a store that hangs does not hold the end
            await anyio.to_thread.run_sync(services.registry.start, abandon_on_cancel=True)
        await anyio.to_thread.run_sync(remove_forgotten_uploads)
        if worker and not starting.cancel_called:  # only now: what starts must not wait for processor time
            await worker.run()

    services.access.tokens.start()
    async with anyio.create_task_group() as tasks:
        # beside the start, not before it: a slow store must not make the process look dead
        tasks.start_soon(start)
        yield
        starting.cancel()
        if worker:
            worker.end()
    services.access.tokens.close()
    services.registry.close()
    if services.jobs:
        with anyio.move_on_after(_CLOSE_S):
            await anyio.to_thread.run_sync(services.jobs.close, abandon_on_cancel=True)


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


def _assemble(
    lifespan: _Lifespan | None, instruments: Instruments, chosen: _Chosen, waiting: WaitingBytes
) -> Application:
    app = Application(
        title="Rover Twin",
        version=service.__version__,
        summary="Where will the rover go, how sure are we, should it drive?",
        description="Trajectories of a rover on a regolith slope: a closed-form solution plus a learned correction.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        separate_input_output_schemas=False,
        generate_unique_id_function=operation_id,
        telemetry={"tracing": False, "metrics": False, "logs": False},  # ours are in tracing and instruments
    )
    larger = {
        ("POST", datasets.router.prefix): chosen.max_upload_bytes,
        **{("POST", each.PATH): max(each.MAX_BODY_BYTES, chosen.max_body_bytes) for each in (batch, drive_batch)},
        **{("POST", each.PATH): max(each.MAX_BODY_BYTES, chosen.max_body_bytes) for each in (drives, steps)},
    }
    answer_to = error_answers()
    templates, trusted = Templates(), networks(chosen.trusted_proxies)
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
        trusted=trusted,
    )
    if tracing.is_on():
        app.add_middleware(RequestSpans)
    if not (chosen.cors_origins or tracing.is_on()):
        app.at_once = AnswersAtOnce(lanes, waiting, answer_to, instruments, trusted)
    answer_to.install(app)
    for router in _ROUTERS:
        app.router.routes += router.routes
    docs.install(app)
    app.router.routes += live.routes
    templates.learn(app.router.routes)
    app.openapi = lambda: openapi_of(app)  # type: ignore[method-assign] # FastAPI's documented way
    return app


def tokens_of(settings: Settings) -> Tokens:
    """The tokens in force. Raises TokenFileError for a file that cannot be used."""
    own = settings.admin_token
    return Tokens(own.get_secret_value() if own else None, settings.tokens_file)


def _failed_logins(settings: Settings) -> FailedLogins:
    return FailedLogins(settings.failed_logins_free, settings.failed_logins_wait_s, settings.failed_logins_clients)


def error_answers() -> ErrorAnswers:
    """How errors are told: as problem documents, under `/v2` as its protocol wants."""
    return ErrorAnswers({PREFIX: failure})
