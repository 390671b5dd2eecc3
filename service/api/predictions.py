"""`/v1/predictions`: one scenario in, one trajectory out, as a GET with a query or a POST with a JSON body."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from email.message import Message
from typing import Annotated, Any

from fastapi import APIRouter, Body, Depends, HTTPException, Query, Request, Response

from service.api.answers import PredictionAnswer
from service.api.encoders import ENCODERS, Format, Subject
from service.api.errors import InvalidInputError, OutsideDomainError, UnsupportedMediaTypeError
from service.api.input_faults import MAX_FAULTS, InputFault, echo, fault
from service.api.inputs import (
    ALLOWED,
    FormatQuery,
    Include,
    PredictionBody,
    PredictionInputs,
    PredictionQuery,
    require_few_points,
)
from service.api.negotiation import choose_format
from service.api.openapi import problem_responses
from service.api.problems import Slug
from service.api.services import Parts, Services
from service.twin import Loaded, Scenario, sample_times

_MAY_REPEAT = frozenset({"include"})
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": PredictionAnswer,
        "description": "The trajectory, in the form asked for.",
        "content": {
            "text/csv": {"schema": {"type": "string"}, "example": "time_s,x_m,y_m\n0.0,0.0,0.0\n0.05,0.0001,0.0\n"}
        },
        "headers": {
            "Rover-Twin-Model": {
                "schema": {"type": "string"},
                "description": "Version that answered, as name@version.",
            },
            "Rover-Twin-Frame": {"schema": {"type": "string", "enum": ["slope", "world"]}},
            "Rover-Twin-Domain": {"schema": {"type": "string", "enum": ["inside", "outside"]}},
            "Rover-Twin-Outcome": {"schema": {"type": "string", "enum": ["climbs", "stalls", "slides"]}},
            "Rover-Twin-Band-Level": {
                "schema": {"type": "number"},
                "description": "Level of the band; only on `include=band`.",
            },
        },
    },
    **problem_responses(
        Slug.INVALID_INPUT,
        Slug.OUTSIDE_DOMAIN,
        Slug.MODEL_NOT_FOUND,
        Slug.VERSION_NOT_FOUND,
        Slug.ALIAS_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.BODY_TOO_LARGE,
        Slug.ARTEFACT_CORRUPT,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}


async def _no_repeated_query(request: Request) -> None:
    """Two values for one field are a mistake; taking either would be a guess."""
    _require_unique(request.query_params.multi_items(), _MAY_REPEAT)


async def _json_object_without_repeats(request: Request) -> None:
    """The body says that it is JSON, and names no field twice."""
    sent = request.headers.get("content-type", "")
    message = Message()
    message["content-type"] = sent
    kind = message.get_content_subtype()
    if not sent or message.get_content_maintype() != "application" or not (kind == "json" or kind.endswith("+json")):
        said = repr(sent[:100]) if sent else "missing"
        raise UnsupportedMediaTypeError(f"Content-Type is {said}, allowed is application/json")
    body = await request.body()
    if body:  # FastAPI has parsed it once already, so it is JSON; it is small
        try:
            json.loads(body, object_pairs_hook=_without_repeats)
        except RecursionError as error:
            raise HTTPException(400) from error


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    _require_unique(pairs)
    return dict(pairs)


def _require_unique(pairs: Sequence[tuple[str, Any]], may_repeat: frozenset[str] = frozenset()) -> None:
    times = Counter(name for name, _ in pairs)
    repeated = [name for name, count in times.items() if count > 1 and name not in may_repeat]
    if repeated:
        raise InvalidInputError(*(_repeated(name, pairs) for name in repeated[:MAX_FAULTS]))


def _repeated(name: str, pairs: Sequence[tuple[str, Any]]) -> InputFault:
    values = ", ".join(str(echo(value)) for each, value in pairs if each == name)
    return fault(name, values, f"one value only, {ALLOWED.get(name, 'if the field were known')}")


router = APIRouter(
    prefix="/v1/predictions", tags=["predictions"], dependencies=[Depends(_no_repeated_query)], responses=_RESPONSES
)


@router.get("", summary="Predict one scenario", response_class=Response, response_model=None)
async def get_prediction(asked: Annotated[PredictionQuery, Query()], request: Request, parts: Parts) -> Response:
    """Where the rover goes on this slope with this mass and torque, and whether the model knows such scenarios."""
    return await _predict(asked, choose_format(asked.format, request.headers.get("accept")), parts)


@router.post(
    "",
    summary="Predict one scenario, asked for in JSON",
    response_class=Response,
    response_model=None,
    dependencies=[Depends(_json_object_without_repeats)],
    responses=problem_responses(Slug.MALFORMED_BODY, Slug.UNSUPPORTED_MEDIA_TYPE),
)
async def post_prediction(
    asked: Annotated[PredictionBody, Body()], form: Annotated[FormatQuery, Query()], request: Request, parts: Parts
) -> Response:
    """The same as the GET, with the fields as one JSON object; `format` stays in the address."""
    return await _predict(asked, choose_format(form.format, request.headers.get("accept")), parts)


async def _predict(asked: PredictionInputs, form: Format, parts: Services) -> Response:
    require_few_points(asked, parts.settings.max_points)
    loaded = await parts.storage.run(lambda: parts.registry.get(asked.model))
    return await parts.predictions.run(lambda: _computed(asked, form, loaded))


def _computed(asked: PredictionInputs, form: Format, loaded: Loaded) -> Response:
    """Runs on a worker thread: everything that takes time, up to the bytes of the answer."""
    scenario = Scenario(asked.slope_deg, asked.mass_kg, asked.torque_nm, asked.horizon_s)
    times = sample_times(asked.horizon_s, asked.dt_s)
    prediction = loaded.twin.predict(scenario, times, asked.frame, asked.wanted_band_level)
    if asked.strict and not prediction.domain.inside:
        raise OutsideDomainError(f"{loaded.twin.name}@{loaded.twin.version}", prediction.domain)
    subject = Subject(loaded, prediction, with_prior=Include.PRIOR in asked.include)
    encoder = ENCODERS[form]
    headers = {"Vary": "Accept", **encoder.headers(subject)}
    return Response(encoder.encode(subject), headers=headers, media_type=encoder.media_type)
