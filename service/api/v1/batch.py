"""`/v1/predictions/batch`: many scenarios in one request, predicted in one array operation."""

from __future__ import annotations

import time
from typing import Annotated, Any

import numpy as np
from fastapi import Query, Request, Response
from pydantic import Field
from pydantic.json_schema import SkipJsonSchema
from starlette.responses import StreamingResponse

from service.api.http.answers.delivery import Delivery
from service.api.http.answers.negotiation import choose
from service.api.http.limits.answer_bytes import TEXT_BYTES, Room
from service.api.http.many_problems import problems_of
from service.api.http.openapi import form_of, problem_responses, schema_of
from service.api.http.problems import Slug
from service.api.http.reading import Route, parsed, require_json
from service.api.http.router import Router
from service.api.services import TheServices
from service.physics.scenario import Array
from service.twin import Count, Loaded
from service.twin.batch import Index, PredictionBatch, predict_finite
from service.wire.batch import BATCH_WORDS, MAX_SCENARIOS, BatchBody, BatchQuestion, read_batch
from service.wire.batch_answer import BatchAnswer
from service.wire.batch_forms import BATCH_ENCODERS, BATCH_MEDIA_TYPES, BatchFormat, BatchSubject, batch_written
from service.wire.prediction import Include
from service.wire.stage_inputs import FleetInputs

PATH = "/v1/predictions/batch"
MAX_BODY_BYTES = 4 << 20
"""Of a batch: a thousand scenarios with long numbers, and 100,000 times of their own."""

_MEANINGS = {
    BatchFormat.NDJSON: "Lines of JSON, streamed, one for each scenario in the order sent: its `index`, then what the "
    "single route answers, or the problem.",
    BatchFormat.NPZ: "NumPy archive: float64 arrays of shape (scenario, time) for each column, `time_s` of shape "
    "(time,) where all scenarios share it, arrays of shape (scenario,), and `metadata`, JSON text.",
    BatchFormat.ARROW: "Arrow IPC stream: one record batch, a row for each scenario and time; the schema's metadata "
    "has the scenarios, their domain, summary and errors as JSON text.",
    BatchFormat.PARQUET: "Parquet file: the table of Arrow, its metadata in the file's key-value metadata.",
    BatchFormat.USDA: "USD text layer: a prim for each scenario, `/Rovers/Rover_<index>` or `<prim_path>_<index>`.",
}
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": BatchAnswer,
        "description": "The trajectories, in the form asked for. Scenarios that were refused are in `errors`.",
        "content": {
            BATCH_ENCODERS[form].media_type: form_of(form is BatchFormat.NDJSON, meaning)
            for form, meaning in _MEANINGS.items()
        },
        "headers": {
            "Rover-Twin-Model": {
                "schema": {"type": "string"},
                "description": "Version that answered, as name@version.",
            },
            "Rover-Twin-Frame": {"schema": {"type": "string", "enum": ["slope", "world"]}},
            "Rover-Twin-Failed": {"schema": {"type": "integer"}, "description": "How many scenarios have no answer."},
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


class BatchFormatQuery(FleetInputs):
    """How the predictions are written."""

    format: Annotated[
        BatchFormat | SkipJsonSchema[None],
        Field(description="Form of the answer; it wins over the `Accept` header. Without both, JSON."),
    ] = None


router = Router(prefix=PATH, tags=["predictions"], responses=_RESPONSES, route_class=Route)


@router.post(
    "",
    summary=f"Predict up to {MAX_SCENARIOS:,} scenarios",
    response_class=Response,
    response_model=None,
    openapi_extra={
        "requestBody": {"required": True, "content": {"application/json": {"schema": schema_of(BatchBody)}}}
    },
)
async def create_prediction_batch(
    form: Annotated[BatchFormatQuery, Query()], request: Request, services: TheServices
) -> Response:
    """Where many rovers go, all with the same step or the same times. A refused scenario does not stop the others."""
    wanted = choose(BATCH_MEDIA_TYPES, form.format, request.headers.get("accept"))
    form.require_usd(wanted)
    require_json(request)
    body = await request.body()
    question, times = await services.predictions.run(lambda: _read(body, services.settings.max_points))
    loaded = await services.twin(question.shared.model)
    await Room.of(request).reserve(request, _estimated_bytes(question, times, wanted))
    subject = await services.predictions.run(lambda: predicted(question, times, loaded, services.instruments.predicted))
    encoder = BATCH_ENCODERS[wanted]
    if encoder.encode is None:
        # never compressed: a line must reach the client when it is written
        stream = encoder.stream(subject) if encoder.stream else ()
        headers = {**subject.headers(), "Vary": "Accept"}
        return StreamingResponse(stream, headers=headers, media_type=encoder.media_type)
    placement, delivery = form.placement(), Delivery.of(request, encoder.media_type, text=encoder.text)
    return await services.predictions.run(
        lambda: delivery.response(batch_written(wanted, subject, placement), subject.headers())
    )


def _estimated_bytes(question: BatchQuestion, time_s: Array, wanted: BatchFormat) -> int:
    """At most so many bytes has an answer whose numbers are all as long as they can be; headers aside."""
    points = time_s.size if time_s.ndim > 1 else time_s.size * len(question.scenarios)
    shared = question.shared
    columns = 3 + 4 * (Include.BAND in shared.include) + 2 * shared.parts.prior
    columns += shared.parts.speed + 2 * shared.parts.wheel_speed
    return points * columns_bytes(columns, wanted)


def columns_bytes(columns: int, form: BatchFormat) -> int:
    """At most so many bytes has one point of an answer."""
    if form is BatchFormat.USDA:
        return (2 * columns + 10) * TEXT_BYTES  # a time code for each number, and seven numbers that move the rover
    return columns * (TEXT_BYTES if BATCH_ENCODERS[form].text else 8)


def _read(body: bytes, max_points: int) -> tuple[BatchQuestion, Array]:
    question = read_batch(parsed(body, BATCH_WORDS))
    return question, question.grid(max_points)


def predicted(question: BatchQuestion, time_s: Array, loaded: Loaded, count: Count) -> BatchSubject:
    """What can be answered, and what is wrong with the rest. `time_s` is the question's grid.

    Raises InvalidValueError for a band or wheel speeds that cannot be had.
    """
    twin, shared = loaded.twin, question.shared

    def predict(rows: Index) -> PredictionBatch:
        times = time_s if time_s.ndim == 1 else time_s[rows]
        began = time.perf_counter()
        found = twin.predict_many(
            question.scenarios.only(rows),
            times,
            shared.frame,
            shared.parts.band_level,
            with_prior=shared.parts.prior,
            with_speed=shared.parts.speed,
            with_wheel_speed=shared.parts.wheel_speed,
        )
        outside = len(found) - int(found.domain.inside.sum())
        count(twin, time.perf_counter() - began, found.summaries.outcome, outside)
        return found

    batch, rows, unanswered = predict_finite(predict, np.arange(len(question.scenarios)))
    failures: dict[int, Exception] = dict(question.failures)
    failures |= {int(question.indices[row]): error for row, error in unanswered.items()}
    if shared.strict and batch is not None and not batch.domain.inside.all():
        for row in np.flatnonzero(~batch.domain.inside).tolist():
            failures[int(question.indices[rows[row]])] = twin.outside(batch.domain[row])
        inside = np.flatnonzero(batch.domain.inside)
        batch, rows = batch.only(inside) if len(inside) else None, rows[inside]
    return BatchSubject(
        loaded=loaded,
        frame=shared.frame,
        batch=batch,
        indices=question.indices[rows],
        failures=problems_of(failures),
        with_prior=shared.parts.prior,
        with_band=Include.BAND in shared.include,
        with_speed=shared.parts.speed,
        with_wheel_speed=shared.parts.wheel_speed,
    )
