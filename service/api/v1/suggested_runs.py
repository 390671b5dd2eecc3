"""`/v1/models/{name}/versions/{version}/suggested-runs`: what to simulate next, as JSON or as a `runs.csv`."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import BeforeValidator
from pydantic.json_schema import SkipJsonSchema

from model_store import Manifest, ModelNotFoundError, layout
from service.api.http.negotiation import choose_format
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.services import Parts
from service.api.v1.models import Name, Version
from service.learning.suggest import MOST_SUGGESTIONS
from service.twin.suggestions import suggestions
from service.wire.forms import MEDIA_TYPES, TableFormat
from service.wire.forms.numbers import dump
from service.wire.suggested_runs import COLUMNS, SuggestedRunsAnswer, document_of, table_of

_COUNTS = frozenset(str(count) for count in range(1, MOST_SUGGESTIONS + 1))
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": SuggestedRunsAnswer,
        "description": "Scenarios to simulate, the most useful first. As CSV: the `runs.csv` of a dataset.",
        "content": {
            "text/csv": {
                "schema": {"type": "string"},
                "example": ",".join(COLUMNS)
                + "\nruns/viper_s30.52_m518.5_t42.8_h10.csv.gz,suggested,30.52,518.5,42.8,10.0,0.001\n",
            }
        },
        "headers": {
            "Rover-Twin-Model": {"schema": {"type": "string"}, "description": "The version, as name@version."},
        },
    },
    **problem_responses(
        Slug.INVALID_INPUT,
        Slug.MODEL_NOT_FOUND,
        Slug.VERSION_NOT_FOUND,
        Slug.NOT_ACCEPTABLE,
        Slug.ARTEFACT_CORRUPT,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}


def _plain_integer(value: object) -> object:
    """A count is written in one way only: 8, not 08, +8 or 8.0."""
    if isinstance(value, str) and value not in _COUNTS:
        raise ValueError(f"a whole number from 1 to {MOST_SUGGESTIONS}")
    return value


Count = Annotated[
    int,
    BeforeValidator(_plain_integer),
    Query(ge=1, le=MOST_SUGGESTIONS, description="How many scenarios to suggest.", examples=[8]),
]
FormatChoice = Annotated[
    TableFormat | SkipJsonSchema[None],
    Query(alias="format", description="Form of the answer; it wins over the `Accept` header. Without both, JSON."),
]

router = APIRouter(prefix="/v1/models/{name}/versions/{version}/suggested-runs", tags=["models"], responses=_RESPONSES)


@router.get("", summary="What to simulate next", response_class=Response, response_model=None)
async def get_suggested_runs(
    name: Name, version: Version, request: Request, parts: Parts, n: Count = 8, asked: FormatChoice = None
) -> Response:
    """The scenarios whose simulation would lower this version's expected error the most, chosen as a batch."""
    if not layout.is_name(name):
        raise ModelNotFoundError(f"no model '{name[:100]}': names have a-z, 0-9 and '-', at most 63 characters")
    form = choose_format(asked, request.headers.get("accept"), TableFormat)
    manifest = await parts.storage.run(lambda: parts.store.manifest(name, version))
    return await parts.predictions.run(lambda: _computed(manifest, n, form))


def _computed(manifest: Manifest, count: int, form: TableFormat) -> Response:
    runs = suggestions(manifest, count)
    body = dump(document_of(manifest, runs)) if form is TableFormat.JSON else table_of(runs).encode()
    headers = {"Vary": "Accept", "Rover-Twin-Model": f"{manifest.name}@{manifest.version}"}
    return Response(body, headers=headers, media_type=MEDIA_TYPES[form])
