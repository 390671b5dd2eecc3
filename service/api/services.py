"""What every route can reach: made once at start (`service.app`), handed down in the typed lifespan state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, TypedDict

from fastapi import Depends, Request

from model_store import ModelStore
from service.api.execution import Line
from service.settings import Settings
from service.twin import TwinRegistry


@dataclass(slots=True)
class Lifecycle:
    """Whether the process was told to end: readiness then answers 503 while running requests finish."""

    draining: bool = False


@dataclass(frozen=True, slots=True)
class Services:
    """The service's parts. `predictions` and `storage` are the two lines of worker threads."""

    settings: Settings
    lifecycle: Lifecycle
    store: ModelStore
    registry: TwinRegistry
    predictions: Line
    storage: Line


class LifespanState(TypedDict):
    """What the lifespan puts into the state of each request."""

    services: Services


async def services_of(request: Request) -> Services:
    """The parts of the service that answers this request."""
    services: Services = request.state.services
    return services


Parts = Annotated[Services, Depends(services_of)]
