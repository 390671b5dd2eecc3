"""`/health`: is the process alive, and can it predict. Never behind authentication.

Who sends a token is told more: where the store is and what its backend said is no business of strangers.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from fastapi import Request
from pydantic import BaseModel, Field
from pydantic.json_schema import SkipJsonSchema

from model_store import StoreError
from service.api.http.exceptions import NotReadyError
from service.api.http.limits.worker_threads import OverloadedError
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
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
    """The default model has just made a prediction. `failures` and `warnings` only with a token."""

    status: Literal["ready"] = "ready"
    model: ModelIdentity
    probe: Probe
    aliases_stale_since: Annotated[
        datetime | None,
        Field(
            description="When the store last said where the aliases point, if the next look is overdue. Until it is "
            "made, predictions go on with the versions of that time."
        ),
    ] = None
    failures: Annotated[
        list[LoadFailure] | SkipJsonSchema[None],
        Field(description="What cannot be loaded or brought up to date. Only with a token."),
    ] = None
    warnings: Annotated[
        list[str] | SkipJsonSchema[None], Field(description="What the operator should look at. Only with a token.")
    ] = None


router = Router(prefix="/health", tags=["health"], route_class=Route)


@router.get("/live", summary="Is the process alive?")
async def get_liveness() -> LiveAnswer:
    """Answers as long as the event loop runs; restart the process when it does not."""
    return LiveAnswer()


@router.get(
    "/ready",
    summary="Can it predict?",
    response_model_exclude_none=True,
    responses=problem_responses(Slug.NOT_READY),
)
async def get_readiness(services: TheServices, request: Request) -> ReadyAnswer:
    """Makes a small prediction with the default model, on a thread of its own: busy is not unready."""
    known = services.access.is_known(request.scope)
    if services.lifecycle.draining:
        raise NotReadyError("the service is shutting down")
    default = services.settings.default_model
    try:
        loaded = await services.twin(give_up_s=PROBE_TIMEOUT_S)
        probe = await services.probes.run(lambda: _probe(loaded), give_up_s=PROBE_TIMEOUT_S)
    except (RoverTwinError, StoreError) as error:
        if isinstance(error, OverloadedError):
            raise NotReadyError(str(error)) from error
        why = str(error) if known else "the log says why, and so does this with a token"
        raise NotReadyError(f"the default model {default} cannot predict: {why}") from error
    except TimeoutError:
        raise NotReadyError(f"the default model {default} gave no answer in {PROBE_TIMEOUT_S:g} s") from None
    stale_since = services.registry.status().stale_since
    answer = ReadyAnswer(model=_identity(loaded), probe=probe, aliases_stale_since=stale_since)
    return answer.model_copy(update=_details(services)) if known else answer


def _probe(loaded: Loaded) -> Probe:
    probed = probe(loaded.twin)
    return Probe(final_x_m=probed.final_x_m, compute_ms=round(probed.took_s * 1000, 3))


def _identity(loaded: Loaded) -> ModelIdentity:
    return ModelIdentity(name=loaded.twin.name, version=loaded.twin.version, alias=loaded.alias)


def _details(services: Services) -> dict[str, object]:
    status = services.registry.status()
    failures = [LoadFailure(reference=reference, message=message) for reference, message in status.failures]
    problem = services.access.tokens.problem
    return {"failures": failures, "warnings": [problem] if problem else []}
