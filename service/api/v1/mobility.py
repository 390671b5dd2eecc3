"""`/v1/mobility`: should the rover go over this slope? Outcome, speed and slip over slope x torque for one mass."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Annotated, Any

import orjson
from fastapi import APIRouter, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute

from service.api.http.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.http.negotiation import choose_format
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.services import Parts
from service.physics.scenario import Array
from service.twin import Loaded
from service.twin.mobility import mobility_map
from service.wire.faults import MAX_FAULTS, InputFault, InvalidInputError, echo, fault
from service.wire.forms import MEDIA_TYPES, TableFormat
from service.wire.forms.numbers import dump
from service.wire.mobility import (
    ALLOWED,
    COLUMNS,
    LAST_COLUMN,
    MobilityAnswer,
    MobilityInputs,
    MobilityQuery,
    document_of,
    mobility_faults,
    table_of,
)


class _MobilityRoute(APIRoute):
    """Says what is wrong with a query in the words of this route's own fields."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()

        async def handle_in_words(request: Request) -> Response:
            times = Counter(name for name, _ in request.query_params.multi_items())
            if repeated := [name for name, count in times.items() if count > 1]:
                raise InvalidInputError(*(_repeated(name, request) for name in repeated[:MAX_FAULTS]))
            try:
                return await handle(request)
            except RequestValidationError as error:
                raise InvalidInputError(*mobility_faults(error.errors())) from error

        return handle_in_words


def _repeated(name: str, request: Request) -> InputFault:
    values = ", ".join(str(echo(value)) for value in request.query_params.getlist(name))
    return fault(name, values, f"one value only, {ALLOWED.get(name, 'if the field were known')}")


_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": MobilityAnswer,
        "description": "The map, in the form asked for; as CSV one line for each torque and slope.",
        "content": {
            "text/csv": {
                "schema": {"type": "string"},
                "example": ",".join([*COLUMNS, LAST_COLUMN]) + "\n60.0,28.0,climbs,0.11,0.7,true,29.5\n",
            }
        },
        "headers": {
            "Rover-Twin-Model": {
                "schema": {"type": "string"},
                "description": "Version that answered, as name@version.",
            },
            "Rover-Twin-Confidence": {
                "schema": {"type": "string"},
                "description": "Confidence of the steepest slopes; `none` when the version has no band.",
            },
            **CACHE_HEADERS,
        },
    },
    **NOT_MODIFIED,
    **problem_responses(
        Slug.INVALID_INPUT,
        Slug.MODEL_NOT_FOUND,
        Slug.VERSION_NOT_FOUND,
        Slug.ALIAS_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.ARTEFACT_CORRUPT,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}

router = APIRouter(prefix="/v1/mobility", tags=["mobility"], responses=_RESPONSES, route_class=_MobilityRoute)


@router.get("", summary="Where the rover climbs, stalls and slides", response_class=Response, response_model=None)
async def get_mobility(asked: Annotated[MobilityQuery, Query()], request: Request, parts: Parts) -> Response:
    """Over slope x torque for one mass: outcome, speed, slip, and for each torque the steepest slope surely climbed."""
    form = choose_format(asked.format, request.headers.get("accept"), TableFormat)
    torques, slopes = asked.torques_nm(), asked.slopes_deg()
    loaded = await parts.storage.run(lambda: parts.registry.get(asked.model))
    question = orjson.dumps(asked.model_dump(exclude={"model", "format"}))
    delivery = Delivery.of(request, MEDIA_TYPES[form], text=True).cacheable(request, loaded, asked.model, question)
    if nothing_new := delivery.not_modified():
        return nothing_new
    return await parts.predictions.run(lambda: _computed(asked, torques, slopes, form, loaded, delivery))


def _computed(
    asked: MobilityInputs, torques: Array, slopes: Array, form: TableFormat, loaded: Loaded, delivery: Delivery
) -> Response:
    """Runs on a worker thread: everything that takes time, up to the bytes of the answer."""
    found = mobility_map(loaded.twin, asked.mass_kg, torques, slopes, asked.horizon_s, asked.confidence)
    headers = {
        "Rover-Twin-Model": f"{loaded.twin.name}@{loaded.twin.version}",
        "Rover-Twin-Confidence": "none" if found.confidence is None else f"{found.confidence:g}",
    }
    body = dump(document_of(loaded, found)) if form is TableFormat.JSON else table_of(found).encode()
    return delivery.response(body, headers)
