"""`/v1/predictions`: one scenario in, one trajectory out, as a GET with a query or a POST with a JSON body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from fastapi import Body, Query, Request, Response

from service.api.http.answers.compression import IDENTITY
from service.api.http.answers.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.http.answers.negotiation import choose
from service.api.http.lanes import LaneRoute, answered_at_once
from service.api.http.openapi import form_of, problem_responses
from service.api.http.problems import Slug
from service.api.http.router import Router
from service.api.http.sent_headers import first_sent
from service.api.services import Services, TheServices
from service.twin import Loaded
from service.wire.forms import ENCODERS, MEDIA_TYPES, Encoder, Format, written
from service.wire.forms.placement import Placement
from service.wire.prediction import (
    FormatQuery,
    PredictionBody,
    PredictionInputs,
    PredictionQuery,
    predict,
    require_few_points,
)
from service.wire.prediction_answer import PredictionAnswer
from service.wire.stage_inputs import StageInputs

_POINTS_AT_ONCE = 1000  # larger answers may wait for clients that read slowly
_COMPRESSED_AT_ONCE = 250  # points: 10 kB of text take gzip a third of a millisecond
_MEANINGS = {
    Format.NPZ: "NumPy archive: a float64 array for each column, and `metadata`, JSON text.",
    Format.ARROW: "Arrow IPC stream: one record batch, a float64 column each; the schema's metadata is JSON text.",
    Format.PARQUET: "Parquet file: a float64 column each; the file's metadata is JSON text, as Arrow's.",
    Format.USDA: "USD text layer: the rover as time samples of `/Rover`, or of your own prim in your stage's axes.",
    Format.SVG: "Plot of the position against time.",
    Format.PNG: "The plot as pixels.",
    Format.HTML: "A page for people: plot, summary, domain, some points as a table. It loads nothing.",
}
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": PredictionAnswer,
        "description": "The trajectory, in the form asked for.",
        "content": {
            "text/csv": {"schema": {"type": "string"}, "example": "time_s,x_m,y_m\n0.0,0.0,0.0\n0.05,0.0001,0.0\n"},
            **{ENCODERS[form].media_type: form_of(ENCODERS[form].text, meaning) for form, meaning in _MEANINGS.items()},
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
        Slug.VERSION_ARCHIVED,
        Slug.VERSION_DELETED,
        Slug.ALIAS_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.BODY_TOO_LARGE,
        Slug.ARTEFACT_CORRUPT,
        Slug.NOT_INSTALLED,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}


def _predict_at_once(asked: PredictionQuery, request: Request, services: Services) -> Response | None:
    """What `get_prediction` answers; None where that has to wait: for a model, for a thread, for room to send."""
    if asked.points > min(_POINTS_AT_ONCE, services.settings.max_points):
        return None
    form = choose(MEDIA_TYPES, asked.format, first_sent(request.scope, b"accept"))
    asked.require_usd(form)
    loaded = services.registry.resident(asked.model)
    if loaded is None:
        return None
    found = _answer(asked, (form, asked.placement()), loaded, request, services)
    return found if isinstance(found, Response) else None


@answered_at_once(_predict_at_once)
async def get_prediction(
    asked: Annotated[PredictionQuery, Query()], request: Request, services: TheServices
) -> Response:
    """Where the rover goes on this slope with this mass and torque, and whether the model knows such scenarios."""
    form = choose(MEDIA_TYPES, asked.format, first_sent(request.scope, b"accept"))
    return await _predict(asked, form, asked, request, services)


async def create_prediction(
    asked: Annotated[PredictionBody, Body()],
    form: Annotated[FormatQuery, Query()],
    request: Request,
    services: TheServices,
) -> Response:
    """The same as the GET, with the fields as one JSON object; `format` stays in the address."""
    chosen = choose(MEDIA_TYPES, form.format, first_sent(request.scope, b"accept"))
    return await _predict(asked, chosen, form, request, services)


async def _predict(
    asked: PredictionInputs, form: Format, stage: StageInputs, request: Request, services: Services
) -> Response:
    stage.require_usd(form)
    if asked.points > services.settings.max_points:
        require_few_points(asked, services.settings.max_points)
    loaded = await services.twin(asked.model)
    found = _answer(asked, (form, stage.placement()), loaded, request, services)
    return found if isinstance(found, Response) else await services.predictions.run(found, asker=request)


def _answer(
    asked: PredictionInputs,
    wanted: tuple[Format, Placement],
    loaded: Loaded,
    request: Request,
    services: Services,
) -> Response | Callable[[], Response]:
    """The answer; where it may take long, what makes it, for a worker thread."""
    form, placement = wanted
    encoder = ENCODERS[form]
    delivery = Delivery.of(request, encoder.media_type, text=encoder.text)
    if request.scope["method"] == "GET":
        delivery = delivery.cacheable(request, loaded, asked.model, asked.question() + placement.question())
        if delivery.known and (nothing_new := delivery.not_modified()):
            return nothing_new
    if loaded.twin.model.quick and asked.points <= _points_at_once(encoder, delivery):
        return _computed(asked, wanted, loaded, delivery, services)
    return lambda: _computed(asked, wanted, loaded, delivery, services)


def _points_at_once(encoder: Encoder, delivery: Delivery) -> int:
    """How many points may be answered on the event loop: handing them to a thread would take longer."""
    most = encoder.points_at_once
    return most if delivery.coding is IDENTITY else min(most, _COMPRESSED_AT_ONCE)


def _computed(
    asked: PredictionInputs, wanted: tuple[Format, Placement], loaded: Loaded, delivery: Delivery, services: Services
) -> Response:
    """Everything that takes time, up to the bytes of the answer; on a worker thread if it may take long."""
    subject = predict(asked, loaded, services.instruments.predicted)
    form, placement = wanted
    return delivery.response(written(form, subject, placement), subject.headers())


router = Router(prefix="/v1/predictions", tags=["predictions"], responses=_RESPONSES)
router.add_api_route(
    "",
    get_prediction,
    methods=["GET"],
    summary="Predict one scenario",
    response_class=Response,
    response_model=None,
    responses=NOT_MODIFIED | {200: {**_RESPONSES[200], "headers": {**_RESPONSES[200]["headers"], **CACHE_HEADERS}}},
    route_class_override=LaneRoute,
)
router.add_api_route(
    "",
    create_prediction,
    methods=["POST"],
    summary="Predict one scenario, asked for in JSON",
    response_class=Response,
    response_model=None,
    responses=problem_responses(Slug.MALFORMED_BODY, Slug.UNSUPPORTED_MEDIA_TYPE),
    route_class_override=LaneRoute,
)
