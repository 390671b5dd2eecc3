"""What every route can reach: made once at start (`service.app`), handed down in the typed lifespan state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, TypedDict, TypeVar

import anyio
from fastapi import Depends, Request

from model_store import Manifest, ModelStore, StoreUnavailableError
from service.api.access import Access
from service.api.http.connections.web_sockets import Connections
from service.api.http.event_stream import MOST_LISTENERS
from service.api.http.instruments import Instruments
from service.api.http.limits.kept import Kept
from service.api.http.limits.pace import Pace
from service.api.http.limits.worker_threads import WorkerThreads
from service.api.http.statistics import Statistics
from service.errors import JobsUnavailableError
from service.fmu import FmuCache
from service.jobs.audit import AuditLog
from service.jobs.queue import JobQueue
from service.learning.suggest import SuggestedRun
from service.settings import Settings
from service.twin import Loaded, TwinRegistry

UPLOADS_AT_ONCE = 2
STORAGE_THREADS = 16
_MUCH = 4  # times as long as a look may take what reads much
_FIRST_CALL = (
    4  # times as long may the first call take: what talks to the database is loaded then, and its tables are made
)
_JOB_THREADS = 4
_HEAVY_THREADS, _HEAVY_WAITING = 1, 16
_PROBES_WAITING = 16
_SUGGESTIONS_KEPT = 16
_JOB_CALLS_WAITING = 64


Result = TypeVar("Result")


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
    instruments: Instruments
    access: Access
    jobs: JobQueue | None = None  # None without any token
    audit: AuditLog | None = None  # in the jobs' database, and called as that is
    pace: Pace | None = None  # of refusing calls that are too many
    storage: WorkerThreads = field(init=False)
    # a line of their own: a database that hangs must not keep the store's readers waiting
    job_calls: WorkerThreads = field(init=False)
    listeners: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(MOST_LISTENERS))
    # maps and suggestions take seconds: those who ask for a prediction do not wait behind them, nor do probes
    heavy: WorkerThreads = field(default_factory=lambda: WorkerThreads("maps", _HEAVY_THREADS, _HEAVY_WAITING))
    probes: WorkerThreads = field(default_factory=lambda: WorkerThreads("readiness probes", 1, _PROBES_WAITING))
    suggestions: Kept[tuple[SuggestedRun, ...]] = field(default_factory=lambda: Kept(_SUGGESTIONS_KEPT))
    models: Kept[Any] = field(default_factory=lambda: Kept(1))  # the list of all models, by the state of the store
    statistics: Statistics = field(default_factory=Statistics)
    figures: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(1))
    fmus: FmuCache = field(default_factory=FmuCache)
    uploads: anyio.CapacityLimiter = field(default_factory=lambda: anyio.CapacityLimiter(UPLOADS_AT_ONCE))

    def __post_init__(self) -> None:
        """Both lines give up a store or a database that hangs."""
        looking = WorkerThreads(
            "store reads", STORAGE_THREADS, self.settings.max_waiting, pace=self.pace, patience=self._store_gave_up
        )
        object.__setattr__(self, "storage", looking)
        calling = WorkerThreads("training job calls", _JOB_THREADS, _JOB_CALLS_WAITING, patience=self._jobs_gave_up)
        object.__setattr__(self, "job_calls", calling)

    def _store_gave_up(self) -> tuple[float, Exception]:
        patience_s = self.settings.store_timeout_s
        return patience_s, StoreUnavailableError(f"the model store did not answer within {patience_s:g} s")

    def _jobs_gave_up(self) -> tuple[float, Exception]:
        patience_s = self.settings.jobs_timeout_s
        if self.jobs is not None and not self.jobs.is_open:
            patience_s *= _FIRST_CALL
        return patience_s, JobsUnavailableError(f"the jobs database did not answer within {patience_s:g} s")

    async def read_much(self, call: Callable[[], Result]) -> Result:
        """`call` on a thread of the store, for longer than a look may take. Raises what the call and the line raise."""
        patience_s = _MUCH * self.settings.store_timeout_s
        try:
            return await self.storage.run(call, give_up_s=patience_s)
        except TimeoutError:
            raise StoreUnavailableError(f"the model store did not answer within {patience_s:g} s") from None

    async def twin(self, reference: str | None = None, *, give_up_s: float | None = None) -> Loaded:
        """What `TwinRegistry.get` returns, from memory without waiting for a thread. Raises what `Line.run` raises."""
        if loaded := self.registry.resident(reference):
            return loaded
        if give_up_s is None:
            return await self.read_much(lambda: self.registry.get(reference))
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
