"""`/v1/drives/batch`: many drives in one request. A refused drive does not stop the others."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import Query, Request, Response
from starlette.responses import StreamingResponse

from service.api.http.answers.delivery import Delivery
from service.api.http.answers.negotiation import choose
from service.api.http.limits.answer_bytes import Room
from service.api.http.many_problems import problems_of
from service.api.http.openapi import form_of, problem_responses, schema_of
from service.api.http.problems import Slug
from service.api.http.reading import Route, parsed, require_json
from service.api.http.router import Router
from service.api.services import TheServices
from service.api.v1.batch import BatchFormatQuery, columns_bytes
from service.twin import Loaded
from service.twin.drives import Drive
from service.twin.scenario import sample_count
from service.wire.batch_forms import BATCH_ENCODERS, BATCH_MEDIA_TYPES, BatchFormat, batch_written
from service.wire.drives.ask import CountDrive, driven_many
from service.wire.drives.batch import DRIVE_BATCH_WORDS, MOST_DRIVES, DriveBatchBody, DrivesQuestion, read_drives
from service.wire.drives.batch_answer import DriveBatchAnswer
from service.wire.drives.batch_subject import DriveBatchSubject

PATH = "/v1/drives/batch"
MAX_BODY_BYTES = 16 << 20
"""Of a batch: two hundred drives with a thousand knots and controls each, or a few with ten thousand."""

_MEANINGS = {
    BatchFormat.NDJSON: "Lines of JSON, streamed, one for each drive in the order sent: its `index`, then what the "
    "single route answers, or the problem.",
    BatchFormat.NPZ: "NumPy archive: arrays of shape (drive, time) for each column, `time_s` of shape (time,) where "
    "all drives share it, arrays of shape (drive,), and `metadata`, JSON text with the events.",
    BatchFormat.ARROW: "Arrow IPC stream: one record batch, a row for each drive and time; the schema's metadata has "
    "the drives, their domain, summary, events and errors as JSON text.",
    BatchFormat.PARQUET: "Parquet file: the table of Arrow, its metadata in the file's key-value metadata.",
    BatchFormat.USDA: "USD text layer: a prim for each drive, `/Rovers/Rover_<index>` or `<prim_path>_<index>`.",
}
_MOST_COLUMNS = 24
_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "model": DriveBatchAnswer,
        "description": "The drives, in the form asked for. Those that were refused are in `errors`.",
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
            "Rover-Twin-Failed": {"schema": {"type": "integer"}, "description": "How many drives have no answer."},
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

router = Router(prefix=PATH, tags=["drives"], responses=_RESPONSES, route_class=Route)


@router.post(
    "",
    summary=f"Drive up to {MOST_DRIVES:,} times",
    response_class=Response,
    response_model=None,
    openapi_extra={
        "requestBody": {"required": True, "content": {"application/json": {"schema": schema_of(DriveBatchBody)}}}
    },
)
async def create_drive_batch(
    form: Annotated[BatchFormatQuery, Query()], request: Request, services: TheServices
) -> Response:
    """Where many rovers go, all with the same step or the same times. What stands beside `drives` holds for all."""
    wanted = choose(BATCH_MEDIA_TYPES, form.format, request.headers.get("accept"))
    form.require_usd(wanted)
    require_json(request)
    body = await request.body()
    question = await services.predictions.run(
        lambda: read_drives(parsed(body, DRIVE_BATCH_WORDS), services.settings.max_points)
    )
    loaded = await services.twin(question.shared.model)
    await Room.of(request).reserve(request, _estimated_bytes(question, wanted))
    subject = await services.predictions.run(lambda: _driven(question, loaded, services.instruments.drove))
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


def _estimated_bytes(question: DrivesQuestion, form: BatchFormat) -> int:
    """At most so many bytes have the columns of the answer."""
    wanted = question.wanted
    own = None if wanted.times_s is None else len(wanted.times_s)
    points = sum(own or sample_count(each.horizon_s, wanted.dt_s) for each in question.drives.values())
    return points * columns_bytes(_MOST_COLUMNS, form)


def _driven(question: DrivesQuestion, loaded: Loaded, count: CountDrive) -> DriveBatchSubject:
    """What can be answered, and what is wrong with the rest.

    Raises InvalidValueError for a version that cannot drive, or a band that cannot be had.
    """
    wanted, asked = question.wanted, question.drives
    answers = driven_many(list(asked.values()), wanted, question.shared.strict, loaded, count)
    found: dict[int, Drive] = {}
    failures: dict[int, Exception] = dict(question.failures)
    for index, answer in zip(asked, answers, strict=True):
        if isinstance(answer, Drive):
            found[index] = answer
        else:
            failures[index] = answer
    return DriveBatchSubject(
        loaded=loaded,
        frame=wanted.frame,
        drives=list(found.values()),
        indices=np.array(list(found), dtype=np.intp),
        failures=problems_of(failures),
        band_level=wanted.band_level if wanted.band else None,
    )
