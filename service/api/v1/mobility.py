"""`/v1/mobility`: should the rover go over this slope? Outcome, speed and slip over slope x torque for one mass."""

from __future__ import annotations

from typing import Annotated, Any

import orjson
from fastapi import Query, Request, Response

from service.api.http.answers.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.http.answers.negotiation import choose
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import TheServices
from service.physics.scenario import Array
from service.twin import Count, Loaded
from service.twin.mobility import mobility_map
from service.wire.forms import ENCODERS, MAP_MEDIA_TYPES, Format, MapFormat
from service.wire.mobility import COLUMNS, LAST_COLUMNS, MobilityAnswer, MobilityInputs, MobilityQuery, written

_MEANINGS = {
    Format.SVG: "The map as a picture: outcomes, contours of the mean speed, steepest slopes; hatched where outside.",
    Format.PNG: "The picture as pixels.",
    Format.HTML: "A page for people: the picture, and the numbers as tables. It loads nothing.",
}

_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": MobilityAnswer,
        "description": "The map, in the form asked for; as CSV one line for each torque and slope.",
        "content": {
            "text/csv": {
                "schema": {"type": "string"},
                "example": ",".join([*COLUMNS, *LAST_COLUMNS]) + "\n60.0,28.0,climbs,0.11,0.7,true,29.5,true\n",
            },
            **{
                ENCODERS[form].media_type: {"schema": {"type": "string", "description": meaning}}
                for form, meaning in _MEANINGS.items()
            },
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
        Slug.VERSION_ARCHIVED,
        Slug.VERSION_DELETED,
        Slug.ALIAS_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.ARTEFACT_CORRUPT,
        Slug.NOT_INSTALLED,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}

router = Router(prefix="/v1/mobility", tags=["mobility"], responses=_RESPONSES, route_class=Route)


@router.get("", summary="Where the rover climbs, stalls and slides", response_class=Response, response_model=None)
async def get_mobility(asked: Annotated[MobilityQuery, Query()], request: Request, services: TheServices) -> Response:
    """Outcome, speed and slip over slope x torque for one mass. For each torque, the steepest slope that is climbed."""
    form = choose(MAP_MEDIA_TYPES, asked.format, request.headers.get("accept"))
    torques, slopes = asked.torques_nm(), asked.slopes_deg()
    loaded = await services.twin(asked.model)
    question = orjson.dumps(asked.model_dump(exclude={"model", "format"}))
    encoder = ENCODERS[Format(form)]
    delivery = Delivery.of(request, encoder.media_type, text=encoder.text).cacheable(
        request, loaded, asked.model, question
    )
    if nothing_new := delivery.not_modified():
        return nothing_new
    return await services.heavy.run(
        lambda: _computed(asked, torques, slopes, form, loaded, delivery, services.instruments.predicted), asker=request
    )


def _computed(
    asked: MobilityInputs,
    torques: Array,
    slopes: Array,
    form: MapFormat,
    loaded: Loaded,
    delivery: Delivery,
    count: Count,
) -> Response:
    """Runs on a worker thread: everything that takes time, up to the bytes of the answer."""
    found = mobility_map(loaded.twin, asked.mass_kg, torques, slopes, asked.horizon_s, asked.confidence, count)
    headers = {
        "Rover-Twin-Model": f"{loaded.twin.name}@{loaded.twin.version}",
        "Rover-Twin-Confidence": "none" if found.confidence is None else f"{found.confidence:g}",
    }
    return delivery.response(written(loaded, found, form), headers)
