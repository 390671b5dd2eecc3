"""`/v1/models/{name}/versions/{version}/suggested-runs`: what to simulate next, as JSON or as a `runs.csv`."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query, Request, Response

from model_store import Manifest, ModelStore
from service.api.http.answers.negotiation import choose
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import TheServices
from service.api.v1.models import Name, Version, require_name
from service.errors import InvalidValueError
from service.learning.suggest import MOST_SUGGESTIONS, SuggestedRun
from service.twin.suggestions import suggestions
from service.wire.forms import TABLE_MEDIA_TYPES, TableFormat
from service.wire.forms.numbers import dump
from service.wire.suggested_runs import COLUMNS, SuggestedRunsAnswer, SuggestedRunsQuery, runs_as_csv, runs_as_json

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
        Slug.NOT_INSTALLED,
        Slug.UNSUPPORTED_FORMAT,
        Slug.STORE_UNAVAILABLE,
        Slug.OVERLOADED,
    ),
}


router = Router(
    prefix="/v1/models/{name}/versions/{version}/suggested-runs",
    tags=["models"],
    responses=_RESPONSES,
    route_class=Route,
)


@router.get("", summary="What to simulate next", response_class=Response, response_model=None)
async def get_suggested_runs(
    name: Name,
    version: Version,
    asked: Annotated[SuggestedRunsQuery, Query()],
    request: Request,
    services: TheServices,
) -> Response:
    """The scenarios whose simulation would lower this version's expected error the most, chosen as a batch."""
    require_name(name)
    form = choose(TABLE_MEDIA_TYPES, asked.format, request.headers.get("accept"))
    manifest = await services.manifest(name, version)
    key = f"{name}@{version} {manifest.created_at.isoformat()}"
    most = await services.suggestions.get(key, lambda: services.heavy.run(lambda: _most(services.store, manifest)))
    if asked.n > len(most):
        raise InvalidValueError("n", asked.n, f"at most {len(most)}: other runs would teach too little")
    return _written(manifest, most[: asked.n], form)


def _most(store: ModelStore, manifest: Manifest) -> tuple[SuggestedRun, ...]:
    """As many as there are: the first ones do not depend on how many are asked for."""
    count = MOST_SUGGESTIONS
    while True:
        try:
            return suggestions(store, manifest, count)
        except InvalidValueError as error:
            if error.field != "n" or count == 1:
                raise
            count //= 2


def _written(manifest: Manifest, runs: tuple[SuggestedRun, ...], form: TableFormat) -> Response:
    body = dump(runs_as_json(manifest, runs)) if form is TableFormat.JSON else runs_as_csv(runs).encode()
    headers = {"Vary": "Accept", "Rover-Twin-Model": f"{manifest.name}@{manifest.version}"}
    return Response(body, headers=headers, media_type=TABLE_MEDIA_TYPES[form])
