"""`POST /v1/steps`: moves rovers on, many in one request; their states travel with requests and answers."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from service.api.http.answers.negotiation import choose
from service.api.http.lanes import LaneRoute
from service.api.http.openapi import form_of, problem_responses, schema_of
from service.api.http.problems import Slug
from service.api.http.reading import parsed, require_json
from service.api.http.router import Router
from service.api.services import TheServices
from service.api.v1.stepping import Stepping, problems
from service.wire.steps.answer import StepsAnswer, encode_steps
from service.wire.steps.arrow import encode_arrow_steps, read_arrow_steps
from service.wire.steps.fleet import Fleet, Stepped
from service.wire.steps.forms import STEPS_MEDIA_TYPES, StepsFormat
from service.wire.steps.question import MAX_ROVERS, STEPS_WORDS, StepsBody, StepsQuestion, read_steps

PATH = "/v1/steps"
ARROW = STEPS_MEDIA_TYPES[StepsFormat.ARROW]
MAX_BODY_BYTES = 24 << 20
"""Of ten thousand rovers with their states."""

_ARROW_QUESTION = (
    "Arrow IPC stream, a row for each rover: `id`, `slope_deg`, `dt_s`, `torque_nm`, `brake`, `state` (binary), and "
    "`mass_kg` and `start_speed_m_s` of a start; all but the first three may be left out, or null. `model` is metadata "
    "of the schema."
)
_ARROW_ANSWER = (
    "Arrow IPC stream, a row for each rover that was moved on: `index` (its place in the request), the numbers, "
    "`inside`, `outside_of` and `state` (binary); the schema's metadata has `model` and `errors` as JSON text."
)
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": StepsAnswer,
        "description": "Where the rovers are at the end of their steps. Rovers that were refused are in `errors`.",
        "content": {ARROW: form_of(text=False, meaning=_ARROW_ANSWER)},
        "headers": {
            "Rover-Twin-Failed": {"schema": {"type": "integer"}, "description": "How many rovers were not moved on."},
        },
    },
    **problem_responses(
        Slug.INVALID_INPUT,
        Slug.MALFORMED_BODY,
        Slug.UNSUPPORTED_MEDIA_TYPE,
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


class StepsQuery(BaseModel):
    """How the answer is written."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Annotated[
        StepsFormat | SkipJsonSchema[None],
        Field(description="Form of the answer; it wins over the `Accept` header. Without both, JSON."),
    ] = None


async def create_steps(form: Annotated[StepsQuery, Query()], request: Request, services: TheServices) -> Response:
    """Each rover begins (`start`) or goes on from a `state`, for `dt_s` on this slope under this control.

    Nothing is kept here: any server that has the version answers the next step. A refused rover does not stop the
    others.
    """
    wanted = choose(STEPS_MEDIA_TYPES, form.format, request.headers.get("accept"))
    arrow = request.headers.get("content-type", "").partition(";")[0].strip().lower() == ARROW
    if not arrow:
        require_json(request)
    body = await request.body()

    def read() -> StepsQuestion:
        return read_arrow_steps(body) if arrow else read_steps(parsed(body, STEPS_WORDS))

    def answer(question: StepsQuestion, found: Stepped) -> Response:
        return _answer(question, found, wanted)

    size = len(body) if not arrow and wanted is StepsFormat.JSON else MAX_BODY_BYTES  # Arrow is never quick
    return await Stepping(services, PATH, Fleet(MAX_ROVERS), read, answer).done(size)


def _answer(question: StepsQuestion, found: Stepped, form: StepsFormat) -> Response:
    """Never compressed: it must be there soon, and states hardly shrink."""
    errors = problems(question, found)
    if form is StepsFormat.ARROW:
        content = encode_arrow_steps(found, errors)
    else:
        content = encode_steps(found, errors, with_state=True)
    headers = {"Vary": "Accept", "Rover-Twin-Failed": str(len(errors))}
    return Response(content, headers=headers, media_type=STEPS_MEDIA_TYPES[form])


router = Router(prefix=PATH, tags=["drives"], responses=_RESPONSES)
router.add_api_route(
    "",
    create_steps,
    methods=["POST"],
    summary=f"Move up to {MAX_ROVERS:,} rovers on by a step each",
    response_class=Response,
    response_model=None,
    route_class_override=LaneRoute,
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                "application/json": {"schema": schema_of(StepsBody)},
                ARROW: {"schema": {"type": "string", "format": "binary", "description": _ARROW_QUESTION}},
            },
        }
    },
)
