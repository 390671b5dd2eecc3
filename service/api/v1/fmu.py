"""`/v1/models/{name}/versions/{version}/fmu`: a version to run inside another simulator."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from service.api.http.answers.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import Services, TheServices
from service.api.v1.models import MODEL_PROBLEMS, Name, Version, require_name
from service.fmu import Fmi, fmu_bytes, tag_of
from service.twin import Twin
from service.twin.load import load_twin

_MEDIA_TYPE = "application/zip"  # FMUs have none of their own
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The FMU: a zip archive.",
        "content": {_MEDIA_TYPE: {"schema": {"type": "string", "format": "binary"}}},
        "headers": {
            "Content-Disposition": {"schema": {"type": "string"}, "description": "A file name for it."},
            **CACHE_HEADERS,
        },
    },
    **NOT_MODIFIED,
    **problem_responses(
        *(Slug.INVALID_INPUT, Slug.MODEL_NOT_FOUND, Slug.VERSION_NOT_FOUND),
        *(Slug.VERSION_ARCHIVED, Slug.VERSION_DELETED),
        *MODEL_PROBLEMS,
    ),
}


class FmuQuery(BaseModel):
    """Which version of the standard."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    fmi: Annotated[Fmi, Field(description="Version of the FMI standard.", examples=["2.0"])] = Fmi.TWO


router = Router(prefix="/v1/models", tags=["models"], responses=_RESPONSES, route_class=Route)


@router.get(
    "/{name}/versions/{version}/fmu", summary="A version as an FMU", response_class=Response, response_model=None
)
async def get_fmu(
    name: Name, version: Version, asked: Annotated[FmuQuery, Query()], request: Request, services: TheServices
) -> Response:
    """A version with the drive model as a Functional Mock-up Unit for co-simulation, FMI 2.0 or 3.0: inputs
    `slope_deg`, `torque_nm` and `brake`, steps of any size, the motion of `POST /v1/steps`. It has libraries for Linux,
    Windows and macOS, and needs neither this service nor Python. The same version always gives the same bytes.
    """
    require_name(name)
    manifest = await services.manifest(name, version)
    await services.storage.run(lambda: services.store.require_usable(name, version))
    tag = await services.storage.run(lambda: tag_of(manifest, asked.fmi))  # of manifests that are long
    delivery = Delivery.of(request, _MEDIA_TYPE, text=False, negotiated=False).tagged(request, tag.encode(), fixed=True)
    if nothing_new := delivery.not_modified():
        return nothing_new
    body = services.fmus.known(tag)
    if body is None:
        twin = await _twin(services, name, version)
        body = await services.predictions.run(lambda: services.fmus.get(tag, lambda: fmu_bytes(twin, asked.fmi)))
    return delivery.response(body, {"Content-Disposition": f'attachment; filename="{name}-{version}.fmu"'})


async def _twin(services: Services, name: str, version: int) -> Twin:
    """From memory or from the store; it takes nobody's place in memory."""
    if loaded := services.registry.resident(f"{name}@{version}"):
        return loaded.twin
    return await services.read_much(lambda: load_twin(services.store, name, version))
