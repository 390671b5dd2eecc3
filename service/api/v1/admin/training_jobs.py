"""`/v1/admin/training-jobs`: ask for a new version, watch it being made, stop it."""

from __future__ import annotations

import re
from typing import Annotated

from fastapi import Body, Depends, Header, Path, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from model_store import DatasetNotFoundError, InvalidReferenceError
from model_store.layout import is_job_id
from service.access.tokens import Scope
from service.api.admin import ADMIN_PROBLEMS, Admin, AdminRoute, about
from service.api.http.answers.negotiation import choose
from service.api.http.event_stream import EventStream
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import words_of
from service.api.http.router import Router
from service.api.services import Services, TheServices
from service.api.v1.admin.idempotency import idempotency_key
from service.api.v1.admin.job_answers import (
    ADDRESS,
    EXAMPLE,
    STREAM_EXAMPLE,
    JobAnswer,
    JobLogAnswer,
    JobsAnswer,
    answer_of,
    log_of,
    page_of,
    text_of,
)
from service.api.v1.admin.job_events import follow, new_events, read_log
from service.errors import InvalidValueError, JobNotFoundError, JobsUnavailableError
from service.jobs.job import JobState, TrainingJob
from service.jobs.queue import JobQueue
from service.jobs.request import TrainingJobRequest
from service.jobs.submission import submit
from service.wire.faults import InputFault, InvalidInputError
from service.wire.whole_numbers import PLAIN_INTEGER

LAST_EVENT_ID = "Last-Event-ID"
_LOOK_AGAIN_S = 2
_LOG_FORMS = {"text": "text/plain", "json": "application/json"}
_EXAMPLE_ID = "0f0e3b5c-6b43-4d0f-a5a5-3a7d3f0b8a10"
_HIGHEST_EVENT = 999_999_999

_Limit = Annotated[int, Field(ge=1, le=500, description="Most entries on a page.", examples=[50]), PLAIN_INTEGER]
_After = Annotated[
    int | SkipJsonSchema[None],
    Field(ge=0, le=_HIGHEST_EVENT, description="Only what came after the event with this number.", examples=[17]),
    PLAIN_INTEGER,
]


class _Query(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class JobsQuery(_Query):
    """Which jobs to list."""

    state: Annotated[JobState | SkipJsonSchema[None], Field(description="Only jobs in this state.")] = None
    model: Annotated[
        str | SkipJsonSchema[None],
        Field(
            max_length=63,
            description="Only jobs for this model.",
            examples=["viper-lunar"],
            json_schema_extra={"x-allowed": "the name of a model"},
        ),
    ] = None
    limit: _Limit = 50
    before: Annotated[
        str | SkipJsonSchema[None],
        Field(
            max_length=36,
            description="Only jobs older than the one with this id; `next` of a page has it.",
            json_schema_extra={"x-allowed": "the id of a training job"},
        ),
    ] = None


class LogQuery(_Query):
    """Which part of a log to read."""

    after: _After = None
    limit: _Limit = 500


class EventsQuery(_Query):
    """Where to go on."""

    after: _After = None


_JOB = problem_responses(Slug.JOB_NOT_FOUND)
_LAST_EVENT_DESCRIPTION = "The last `id` that was received; the stream continues after it. It wins over `after`."

router = Router(
    prefix=ADDRESS,
    tags=["training jobs"],
    route_class=AdminRoute,
    responses=problem_responses(*ADMIN_PROBLEMS, Slug.JOBS_UNAVAILABLE, Slug.OVERLOADED),
)


def _queue_of(services: TheServices) -> JobQueue:
    if services.jobs is None:
        raise JobsUnavailableError("this service was started without training jobs")
    return services.jobs


Queue = Annotated[JobQueue, Depends(_queue_of)]


async def _known_id(
    job_id: Annotated[str, Path(description="Id of a training job.", examples=[_EXAMPLE_ID])],
) -> str:
    """In an address a malformed id is simply one that does not exist."""
    if not is_job_id(job_id):
        raise JobNotFoundError(f"there is no training job '{job_id[:100]}'")
    return job_id


JobId = Annotated[str, Depends(_known_id)]


@router.post(
    "",
    status_code=202,
    summary="Start a training job",
    responses={
        202: {
            "description": "The job is queued and survives a restart. A known `Idempotency-Key` answers its job.",
            "headers": {
                "Location": {"schema": {"type": "string"}, "description": "Address of the job."},
                "Retry-After": {
                    "schema": {"type": "integer"},
                    "description": "Seconds to wait before asking for the job.",
                },
            },
        },
        **problem_responses(
            *(Slug.INVALID_INPUT, Slug.IDEMPOTENCY_KEY_REUSED, Slug.QUEUE_FULL, Slug.MALFORMED_BODY),
            *(Slug.UNSUPPORTED_MEDIA_TYPE, Slug.BODY_TOO_LARGE, Slug.ARTEFACT_CORRUPT, Slug.UNSUPPORTED_FORMAT),
            *(Slug.STORE_UNAVAILABLE, Slug.JOBS_UNAVAILABLE, Slug.OVERLOADED),
        ),
    },
)
async def create_training_job(
    asked: Annotated[TrainingJobRequest, Body(openapi_examples={"usual": {"value": EXAMPLE}})],
    response: Response,
    actor: Admin,
    key: Annotated[str | None, Depends(idempotency_key)],
    queue: Queue,
    services: TheServices,
) -> JobAnswer:
    """Train a new version of a model on stored datasets. A request that cannot succeed is refused at once."""
    job = await services.job_calls.run(lambda: _submitted(services, queue, asked, actor, key))
    about(f"job {job.id} of {job.request.model}")
    response.headers["Location"] = f"{ADDRESS}/{job.id}"
    response.headers["Retry-After"] = str(_LOOK_AGAIN_S)
    return answer_of(job)


def _submitted(
    services: Services, queue: JobQueue, asked: TrainingJobRequest, actor: str, key: str | None
) -> TrainingJob:
    """A dataset that is not there is a wrong value here, not a wrong address."""
    try:
        return submit(services.store, queue, asked, actor=actor, key=key)[0]
    except (DatasetNotFoundError, InvalidReferenceError) as error:
        names = ", ".join(asked.datasets)
        words = words_of(TrainingJobRequest)["datasets"]
        raise InvalidInputError(InputFault("datasets", names, words, str(error))) from error


@router.get("", summary="All training jobs")
async def list_training_jobs(
    asked: Annotated[JobsQuery, Query()], _: Admin, queue: Queue, services: TheServices
) -> JobsAnswer:
    """The jobs, newest first, a page at a time."""
    jobs = await services.job_calls.run(lambda: _listed(queue, asked))
    chosen = {"state": asked.state, "model": asked.model}
    return page_of(jobs, asked.limit, {name: value for name, value in chosen.items() if value is not None})


def _listed(queue: JobQueue, asked: JobsQuery) -> list[TrainingJob]:
    """One more than asked for, to know whether there are more. A `before` that is no job is a wrong value."""
    try:
        return queue.list(state=asked.state, model=asked.model, limit=asked.limit + 1, before=asked.before)
    except JobNotFoundError as error:
        raise InvalidValueError("before", asked.before, words_of(JobsQuery)["before"]) from error


@router.get("/{job_id}", summary="One training job", responses=_JOB)
async def get_training_job(job_id: JobId, _: Admin, queue: Queue, services: TheServices) -> JobAnswer:
    """Where the job stands, and what came out of it."""
    return answer_of(await services.job_calls.run(lambda: queue.get(job_id)))


@router.post(
    "/{job_id}/cancel",
    status_code=202,
    summary="Cancel a training job",
    responses=problem_responses(Slug.JOB_NOT_FOUND, Slug.JOB_ENDED),
)
async def cancel_training_job(job_id: JobId, _: Admin, queue: Queue, services: TheServices) -> JobAnswer:
    """Stop a job that waits or runs; a running one stops within seconds and publishes nothing."""
    about(f"job {job_id}")
    return answer_of(await services.job_calls.run(lambda: queue.cancel(job_id)))


@router.get(
    "/{job_id}/logs",
    summary="The log of a training job",
    response_class=Response,
    response_model=None,
    responses={
        200: {
            "model": JobLogAnswer,
            "description": "The lines, oldest first: as text unless JSON is preferred.",
            "content": {"text/plain": {"schema": {"type": "string"}, "example": "2026-01-01T12:00:00+00:00 fitting\n"}},
            "headers": {
                "Link": {"schema": {"type": "string"}, "description": 'With rel="next" when there may be more lines.'}
            },
        },
        **problem_responses(Slug.JOB_NOT_FOUND, Slug.NOT_ACCEPTABLE),
    },
)
async def get_training_job_log(
    job_id: JobId, asked: Annotated[LogQuery, Query()], request: Request, _: Admin, queue: Queue, services: TheServices
) -> Response:
    """What the job has said so far."""
    form = choose(_LOG_FORMS, None, request.headers.get("accept"))
    lines, goes_on_after = await services.job_calls.run(lambda: read_log(queue, job_id, asked.after, asked.limit))
    answer = log_of(job_id, lines, goes_on_after, asked.limit)
    headers = {"Vary": "Accept"} | ({"Link": f'<{answer.next}>; rel="next"'} if answer.next else {})
    content = answer.model_dump_json() if form == "json" else text_of(lines)
    return Response(content, headers=headers, media_type=_LOG_FORMS[form])


@router.get(
    "/{job_id}/events",
    summary="The events of a training job, live",
    response_class=Response,
    response_model=None,
    responses={
        200: {
            "description": "Server-sent events: `state`, `progress` and `log`, each with a number as its `id` and a "
            "JSON object with `time` as its data; a comment every 15 s. The stream ends with the job's last state. "
            "After a lost connection, `Last-Event-ID` continues it. It ends early when its token is revoked.",
            "content": {"text/event-stream": {"schema": {"type": "string"}, "example": STREAM_EXAMPLE}},
        },
        204: {"description": "The job has ended and there is no later event. Do not ask again."},
        **problem_responses(Slug.JOB_NOT_FOUND),
    },
)
async def list_training_job_events(
    job_id: JobId,
    asked: Annotated[EventsQuery, Query()],
    request: Request,
    _: Admin,
    queue: Queue,
    services: TheServices,
    last_event_id: Annotated[str | None, Header(alias=LAST_EVENT_ID, description=_LAST_EVENT_DESCRIPTION)] = None,
) -> Response:
    """Follow a job while it runs, from its beginning or from where a connection was lost."""
    # an empty one is none, as the specification of server-sent events has it
    after = _event_number(last_event_id) if last_event_id else asked.after
    news = await services.job_calls.run(lambda: new_events(queue, job_id, after))
    if news is None:
        return Response(status_code=204)

    def admitted() -> bool:
        return services.access.still_holds(request.scope, Scope.READ)

    return EventStream(follow(services, queue, job_id, news, after, admitted), services.listeners)


def _event_number(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text):
        raise InvalidValueError(LAST_EVENT_ID, text[:100], f"a whole number from 0 to {_HIGHEST_EVENT}")
    return int(text)
