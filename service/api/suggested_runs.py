"""`/v1/models/{name}/versions/{version}/suggested-runs`: what to simulate next, as JSON or as a `runs.csv`."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import BeforeValidator
from pydantic.json_schema import SkipJsonSchema

from model_store import Manifest, ModelNotFoundError, layout
from service.api.answers import SuggestedRunsAnswer
from service.api.encoders import MEDIA_TYPES, TableFormat
from service.api.encoders.numbers import dump
from service.api.models import Name, Version
from service.api.negotiation import choose_format
from service.api.openapi import problem_responses
from service.api.problems import Slug
from service.api.services import Parts
from service.errors import CheckpointError, InvalidValueError
from service.learning.domain import Domain
from service.learning.suggest import MOST_SUGGESTIONS, SuggestedRun, suggest_runs
from service.physics.priors import restore_prior

COLUMNS = ("file", "set", "slope_deg", "mass_kg", "torque_nm", "horizon_s", "step_s")
_SET = "suggested"
_STEP_S = 0.001  # of the shipped runs over the whole space
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


def suggestions(manifest: Manifest, count: int) -> tuple[SuggestedRun, ...]:
    """What to simulate to make the next version better than this one.

    Raises InvalidValueError for a version that does not list its runs, and what `suggest_runs` raises; CheckpointError
    for a manifest that does not fit.
    """
    version = f"{manifest.name}@{manifest.version}"
    checkpoint: Mapping[str, Any] = manifest.checkpoint
    try:
        prior = restore_prior(checkpoint["prior"])
        domain = Domain.restore(manifest.domain, prior.rover, prior.regolith)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise CheckpointError(f"{version}: the manifest does not fit: {error}") from error
    if domain.neighbourhood is None:
        raise InvalidValueError(
            "version", version, "a version whose manifest lists its training runs (domain.runs); train a new one"
        )
    return suggest_runs(domain.neighbourhood, domain.spans, count)


def document_of(manifest: Manifest, runs: tuple[SuggestedRun, ...]) -> dict[str, Any]:
    """The JSON answer: a `service.api.answers.SuggestedRunsAnswer`."""
    return {
        "model": {"name": manifest.name, "version": manifest.version},
        "runs": [
            dict(zip(COLUMNS, _row(run), strict=True))
            | {
                "reason": {
                    "expected_error_m": run.expected_error_m,
                    "distance": run.distance,
                    "nearest_run": run.nearest_run,
                }
            }
            for run in runs
        ],
    }


def table_of(runs: tuple[SuggestedRun, ...]) -> str:
    """The `runs.csv` that a simulation script reads, and that an import finds beside the files it wrote."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows(map(_row, runs))
    return text.getvalue()


def _row(run: SuggestedRun) -> tuple[object, ...]:
    scenario = f"s{run.slope_deg}_m{run.mass_kg}_t{run.torque_nm}_h{run.horizon_s:g}"
    file = f"runs/viper_{scenario}.csv.gz"
    return file, _SET, run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s, _STEP_S
