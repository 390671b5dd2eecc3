"""The addresses of the protocol. Without a version in the address, the model's `champion` answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Annotated, Any, TypeVar

from fastapi import Path, Request, Response
from pydantic import BaseModel, Field

import service
from service.api import health
from service.api.admin import Admin, AdminRoute
from service.api.http.exceptions import NotReadyError
from service.api.http.lanes import LaneRoute
from service.api.http.openapi import schema_of
from service.api.http.reading import Route, parsed, validated, whole_body
from service.api.http.router import Router
from service.api.http.sent_headers import first_sent
from service.api.services import Services, TheServices
from service.api.v2.answer import Bounds, Call, InferenceAnswer, answer, read
from service.api.v2.failures import PREFIX, failure_responses
from service.api.v2.metadata import ModelConfiguration, ModelMetadata, configuration_of, metadata_of
from service.api.v2.repository import (
    IndexEntry,
    IndexRequest,
    RepositoryRequest,
    index_of,
    reference_of,
    require_loadable,
    unload,
)
from service.api.v2.statistics_answer import ModelStatistics
from service.api.v2.wire import HEADER_LENGTH, InferenceRequest

EXTENSIONS = ("binary_tensor_data", "model_repository", "model_configuration", "parameters", "statistics")
_HEADER_LENGTH = HEADER_LENGTH.lower().encode()
_READ_AT_ONCE = 4096  # bytes of a body that the event loop itself may read
Body = TypeVar("Body", bound=BaseModel)
Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])

router = Router(prefix=PREFIX, tags=["inference protocol"], responses=failure_responses(), route_class=Route)
_OF_MODEL = failure_responses(404, 501, 503)

Name = Annotated[str, Path(description="Name of a model.", examples=["viper-lunar"])]
Version = Annotated[str, Path(description="Number of a version, or an alias.", examples=["1", "champion"])]


class ServerMetadata(BaseModel):
    """The server."""

    name: str
    version: str
    extensions: list[str]


class ServerLive(BaseModel):
    """Whether the process is alive."""

    live: bool


class ServerReady(BaseModel):
    """Whether the service can predict. `live` is part of the protocol's text."""

    live: bool
    ready: bool
    error: str = Field(default="", description="Reason, when not ready.")


class ModelReady(BaseModel):
    """Whether a model can predict."""

    name: str
    ready: bool


class ModelNames(BaseModel):
    """The names of all models."""

    models: list[str]


@router.get("", summary="The server and its extensions")
async def get_server_metadata() -> ServerMetadata:
    """Name, version and which extensions of the protocol there are."""
    return ServerMetadata(name="rover-twin", version=service.__version__, extensions=list(EXTENSIONS))


router.add_api_route("/", get_server_metadata, include_in_schema=False)  # so the protocol's OpenAPI document writes it


@router.get("/health/live", summary="Is the server alive?")
async def get_server_live() -> ServerLive:
    """Answers as long as the event loop runs."""
    return ServerLive(live=True)


@router.get(
    "/health/ready",
    summary="Can the server predict?",
    responses={503: {"model": ServerReady, "description": "Not now; `error` says why."}},
)
async def get_server_ready(services: TheServices, request: Request, response: Response) -> ServerReady:
    """Makes a small prediction with the default model; other models are loaded when they are asked for."""
    try:
        await health.get_readiness(services, request)
    except NotReadyError as error:
        response.status_code = 503
        return ServerReady(live=True, ready=False, error=str(error))
    return ServerReady(live=True, ready=True)


@router.get("/models", summary="Names of the models", responses=failure_responses(503))
async def list_model_names(services: TheServices) -> ModelNames:
    """As KServe lists them."""
    return ModelNames(models=await services.storage.run(services.store.model_names))


@router.get("/models/stats", summary="Statistics of all models")
async def list_statistics(services: TheServices) -> ModelStatistics:
    """Counts and times of all versions that were asked since this process started."""
    return ModelStatistics.model_validate({"model_stats": services.statistics.documents()})


@router.get("/models/{name}", summary="A model and its tensors", responses=_OF_MODEL)
async def get_model_metadata(name: Name, services: TheServices) -> ModelMetadata:
    """Inputs and outputs with their units and ranges, of the version that answers now."""
    return await _metadata(reference_of(name), services)


@router.get("/models/{name}/versions/{version}", summary="A version and its tensors", responses=_OF_MODEL)
async def get_version_metadata(name: Name, version: Version, services: TheServices) -> ModelMetadata:
    """Inputs and outputs with their units and ranges."""
    return await _metadata(reference_of(name, version), services)


@router.get("/models/{name}/ready", summary="Can a model predict?", responses=_OF_MODEL)
async def get_model_ready(name: Name, services: TheServices) -> ModelReady:
    """Loads the model if it is not in memory."""
    return await _ready(reference_of(name), services)


@router.get("/models/{name}/versions/{version}/ready", summary="Can a version predict?", responses=_OF_MODEL)
async def get_version_ready(name: Name, version: Version, services: TheServices) -> ModelReady:
    """Loads the version if it is not in memory."""
    return await _ready(reference_of(name, version), services)


@router.get("/models/{name}/config", summary="Triton's configuration of a model", responses=_OF_MODEL)
async def get_model_configuration(name: Name, services: TheServices) -> ModelConfiguration:
    """Made from the model's metadata."""
    return await services.storage.run(lambda: configuration_of(services.store, reference_of(name)))


@router.get(
    "/models/{name}/versions/{version}/config", summary="Triton's configuration of a version", responses=_OF_MODEL
)
async def get_version_configuration(name: Name, version: Version, services: TheServices) -> ModelConfiguration:
    """Made from the version's metadata."""
    return await services.storage.run(lambda: configuration_of(services.store, reference_of(name, version)))


@router.get("/models/{name}/stats", summary="Statistics of a model", responses=_OF_MODEL)
async def get_model_statistics(name: Name, services: TheServices) -> ModelStatistics:
    """Counts and times of its versions that were asked since this process started."""
    reference = reference_of(name)
    await services.storage.run(lambda: services.store.versions(reference))
    return ModelStatistics.model_validate({"model_stats": services.statistics.documents(name)})


@router.get("/models/{name}/versions/{version}/stats", summary="Statistics of a version", responses=_OF_MODEL)
async def get_version_statistics(name: Name, version: Version, services: TheServices) -> ModelStatistics:
    """Counts and times since this process started."""
    reference = reference_of(name, version)
    resolved = await services.storage.run(lambda: services.store.resolve(reference))
    return ModelStatistics.model_validate(
        {"model_stats": services.statistics.documents(resolved.name, resolved.version)}
    )


def _body(model: type[BaseModel], *, required: bool = False, example: dict[str, Any] | None = None) -> dict[str, Any]:
    media: dict[str, Any] = {"schema": schema_of(model)} | ({"example": example} if example else {})
    return {"requestBody": {"required": required, "content": {"application/json": media}}}


_EXAMPLE = {
    "id": "7",
    "inputs": [
        {"name": "slope_deg", "shape": [2], "datatype": "FP64", "data": [20, 28]},
        {"name": "mass_kg", "shape": [2], "datatype": "FP64", "data": [430, 430]},
        {"name": "torque_nm", "shape": [2], "datatype": "FP64", "data": [60, 60]},
    ],
    "outputs": [{"name": "x_m"}, {"name": "outcome"}],
}
_INFER: dict[str, Any] = {
    "response_model": None,
    "response_class": Response,
    "openapi_extra": _body(InferenceRequest, required=True, example=_EXAMPLE),
    "responses": failure_responses(400, 404, 413, 415, 501, 503)
    | {
        200: {
            "model": InferenceAnswer,
            "description": f"The outputs asked for. With binary ones the JSON, of {HEADER_LENGTH} bytes, comes first.",
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
            "headers": {HEADER_LENGTH: {"schema": {"type": "integer"}, "description": "Only with binary outputs."}},
        }
    },
}


async def infer_model(name: Name, request: Request, services: TheServices) -> Response:
    """Tensors of scenarios in, tensors of trajectories out; JSON or binary either way."""
    return await _infer(reference_of(name), request, services)


async def infer_version(name: Name, version: Version, request: Request, services: TheServices) -> Response:
    """Tensors of scenarios in, tensors of trajectories out; JSON or binary either way."""
    return await _infer(reference_of(name, version), request, services)


for _path, _endpoint, _summary in (
    ("/models/{name}/infer", infer_model, "Predict many scenarios"),
    ("/models/{name}/versions/{version}/infer", infer_version, "Predict many scenarios by a version"),
):
    router.add_api_route(_path, _endpoint, methods=["POST"], summary=_summary, route_class_override=LaneRoute, **_INFER)


@router.post(
    "/repository/index",
    summary="All versions and whether they are in memory",
    openapi_extra=_body(IndexRequest),
    responses=failure_responses(400, 413, 503),
)
async def list_repository(request: Request, services: TheServices) -> list[IndexEntry]:
    """One entry for each published version. Why one cannot be loaded is told to those who send a token."""
    asked = _read(IndexRequest, await request.body())
    known = services.access.is_known(request.scope)
    return await services.storage.run(
        lambda: index_of(services.store, services.registry.status(), asked.ready, with_reasons=known)
    )


def _admin_route(path: str, summary: str) -> Callable[[Endpoint], Endpoint]:
    """Declares a route of the repository that changes what is in memory."""

    def declare(endpoint: Endpoint) -> Endpoint:
        router.add_api_route(
            path,
            endpoint,
            methods=["POST"],
            summary=summary,
            route_class_override=AdminRoute,
            openapi_extra=_body(RepositoryRequest),
            response_class=Response,
            responses=failure_responses(400, 401, 403, 404, 413, 429, 501, 503),
        )
        return endpoint

    return declare


@_admin_route("/repository/models/{name}/load", "Load a model")
async def load_model(name: Name, request: Request, services: TheServices, _: Admin) -> Response:
    """Brings the model's champion into memory before the first request. Needs a token of scope admin."""
    require_loadable(_read(RepositoryRequest, await request.body()).parameters)
    await services.twin(reference_of(name))
    return Response()


@_admin_route("/repository/models/{name}/unload", "Unload a model")
async def unload_model(name: Name, request: Request, services: TheServices, _: Admin) -> Response:
    """Drops all versions of the model from memory. A later request loads them again. The default model stays.

    Needs a token of scope admin.
    """
    _read(RepositoryRequest, await request.body())
    reference = reference_of(name)
    default = services.settings.default_model
    await services.storage.run(lambda: unload(services.registry, services.store, reference, default))
    return Response()


async def _infer(reference: str, request: Request, services: Services) -> Response:
    arrived_ns = time.perf_counter_ns()
    loaded = await services.twin(reference)
    encoding = (first_sent(request.scope, b"content-encoding") or "").strip().lower()
    call = Call(await whole_body(request), first_sent(request.scope, _HEADER_LENGTH), encoding, arrived_ns)
    bounds = Bounds(services.settings.max_points, services.settings.max_body_bytes)
    if len(call.body) <= _READ_AT_ONCE and not encoding:
        inference = read(call, loaded, bounds, services.statistics)
    else:
        inference = await services.predictions.run(lambda: read(call, loaded, bounds, services.statistics))
    if inference.quick:
        return answer(inference, services.instruments.predicted)
    return await services.predictions.run(lambda: answer(inference, services.instruments.predicted))


async def _metadata(reference: str, services: Services) -> ModelMetadata:
    return await services.storage.run(lambda: metadata_of(services.store, reference))


async def _ready(reference: str, services: Services) -> ModelReady:
    if services.lifecycle.draining:
        raise NotReadyError("the service is shutting down")
    loaded = await services.twin(reference)
    return ModelReady(name=loaded.twin.name, ready=True)


def _read(model: type[Body], content: bytes) -> Body:
    """A body that may be empty. Raises MalformedBodyError and InvalidInputError."""
    return validated(model, parsed(content, {}), "body") if content else model()
