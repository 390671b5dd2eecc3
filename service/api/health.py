"""`/health`: is the process alive, and can it predict. Never behind authentication."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter
from pydantic import BaseModel

from model_store import StoreError
from service.api.http.exceptions import NotReadyError
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.worker_threads import OverloadedError
from service.api.services import Services, TheServices
from service.errors import RoverTwinError
from service.twin import Loaded
from service.twin.probe import probe
from service.wire.prediction_answer import ModelIdentity

PROBE_TIMEOUT_S = 3.0


class LiveAnswer(BaseModel):
    """The process answers."""

    status: Literal["alive"] = "alive"


class Probe(BaseModel):
    """The prediction that proved readiness."""

    final_x_m: float
    compute_ms: float


class LoadFailure(BaseModel):
    """A model reference that cannot be loaded or brought up to date."""

    reference: str
    message: str


class ReadyAnswer(BaseModel):
    """The default model has just made a prediction."""

    status: Literal["ready"] = "ready"
    model: ModelIdentity
    probe: Probe
    failures: list[LoadFailure]


router = APIRouter(prefix="/health", tags=["health"], route_class=Route)


@router.get("/live", summary="Is the process alive?")
async def live() -> LiveAnswer:
    """Answers as long as the event loop runs; restart the process when it does not."""
    return LiveAnswer()


@router.get("/ready", summary="Can it predict?", responses=problem_responses(Slug.NOT_READY))
async def ready(services: TheServices) -> ReadyAnswer:
    """Makes a small prediction with the default model, on a thread of its own: busy is not unready."""
    if services.lifecycle.draining:
        raise NotReadyError("the service is shutting down")
    default = services.settings.default_model
    try:
        loaded = await services.twin(give_up_s=PROBE_TIMEOUT_S)
        probe = await services.probes.run(lambda: _probe(loaded), give_up_s=PROBE_TIMEOUT_S)
    except (RoverTwinError, StoreError) as error:
        if isinstance(error, OverloadedError):
            raise NotReadyError(str(error)) from error
        raise NotReadyError(f"the default model {default} cannot predict: {error}") from error
    except TimeoutError:
        raise NotReadyError(f"the default model {default} gave no answer in {PROBE_TIMEOUT_S:g} s") from None
    return ReadyAnswer(model=_identity(loaded), probe=probe, failures=_failures(services))


def _probe(loaded: Loaded) -> Probe:
    probed = probe(loaded.twin)
    return Probe(final_x_m=probed.final_x_m, compute_ms=round(probed.took_s * 1000, 3))


def _identity(loaded: Loaded) -> ModelIdentity:
    return ModelIdentity(name=loaded.twin.name, version=loaded.twin.version, alias=loaded.alias)


def _failures(services: Services) -> list[LoadFailure]:
    status = services.registry.status()
    return [LoadFailure(reference=reference, message=message) for reference, message in status.failures]
