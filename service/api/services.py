"""What every route can reach: made once at start (`service.app`), handed down in the typed lifespan state."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, TypedDict

import anyio
from fastapi import Depends, Request

from model_store import Manifest, ModelStore
from service.api.access import Access
from service.api.http.event_stream import MOST_LISTENERS
from service.api.http.instruments import Instruments
from service.api.http.kept import Kept
from service.api.http.statistics import Statistics
from service.api.http.web_sockets import Connections
from service.api.http.worker_threads import WorkerThreads
from service.fmu import FmuCache
from service.jobs.audit import AuditLog
from service.jobs.queue import JobQueue
from service.learning.suggest import SuggestedRun
from service.settings import Settings
from service.twin import Loaded, TwinRegistry

UPLOADS_AT_ONCE = 2
_JOB_THREADS = 4
_HEAVY_THREADS, _HEAVY_WAITING = 1, 16
_PROBES_WAITING = 16
_SUGGESTIONS_KEPT = 16
_JOB_CALLS_WAITING = 64


@dataclass(slots=True)
class Lifecycle:
    """Whether the process was told to end: readiness then answers 503 while running requests finish."""

    draining: bool = False
    ending: bool = False  # no more requests are taken: streams that could go on for hours end now
    live: Connections = field(default_factory=Connections)


@dataclass(frozen=True, slots=True)
class Services:
    """What requests are answered with. `predictions`, `storage` and `job_calls` are worker threads; `listeners`
    counts who follows a job, `figures` who draws, `uploads` those that are coming in or being imported. `fmus` are
    those that were made lately. `statistics`
    are those of the inference protocol.
    """

    settings: Settings
    lifecycle: Lifecycle
    store: ModelStore
    registry: TwinRegistry
    predictions: WorkerThreads
    storage: WorkerThreads
    instruments: Instruments
    access: Access
    jobs: JobQueue | None = None  # None without any token
    audit: AuditLog | None = None  # in the jobs' database, and called as that is
    # a line of their own: a database that hangs must not keep the store's readers waiting
    job_calls: WorkerThreads = field(
        default_factory=lambda: WorkerThreads("training job calls", _JOB_THREADS, _JOB_CALLS_WAITING)
    )
    listeners: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(MOST_LISTENERS))
    # maps and suggestions take seconds: those who ask for a prediction do not wait behind them, nor do probes
    heavy: WorkerThreads = field(default_factory=lambda: WorkerThreads("maps", _HEAVY_THREADS, _HEAVY_WAITING))
    probes: WorkerThreads = field(default_factory=lambda: WorkerThreads("readiness probes", 1, _PROBES_WAITING))
    suggestions: Kept[tuple[SuggestedRun, ...]] = field(default_factory=lambda: Kept(_SUGGESTIONS_KEPT))
    statistics: Statistics = field(default_factory=Statistics)
    figures: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(1))
    fmus: FmuCache = field(default_factory=FmuCache)
    uploads: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(UPLOADS_AT_ONCE))

    async def twin(self, reference: str | None = None, *, give_up_s: float | None = None) -> Loaded:
        """What `TwinRegistry.get` returns, from memory without waiting for a thread. Raises what `Line.run` raises."""
        if loaded := self.registry.resident(reference):
            return loaded
        return await self.storage.run(lambda: self.registry.get(reference), give_up_s=give_up_s)

    async def manifest(self, name: str, version: int) -> Manifest:
        """The manifest of a version, from memory where it is resident. Raises what the store and `run` raise."""
        if loaded := self.registry.resident(f"{name}@{version}"):
            return loaded.twin.manifest
        return await self.storage.run(lambda: self.store.manifest(name, version))


class LifespanState(TypedDict):
    """What the lifespan puts into the state of each request."""

    services: Services


async def services_of(request: Request) -> Services:
    """The services of the app that answers this request."""
    services: Services = request.state.services
    return services


TheServices = Annotated[Services, Depends(services_of)]
