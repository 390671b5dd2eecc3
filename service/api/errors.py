"""From what went wrong to the answer: the only place that turns exceptions into problems."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any
from urllib.parse import quote

import orjson
import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.types import Scope

from model_store import (
    AliasNotFoundError,
    AlreadyExistsError,
    ConflictError,
    CorruptArtefactError,
    DatasetNotFoundError,
    InvalidDraftError,
    ModelNotFoundError,
    NotFoundError,
    StoreError,
    StoreUnavailableError,
    UnsupportedFormatError,
    VersionNotFoundError,
)
from service.api.dataset_answers import report_document
from service.api.encoders.json import domain_document
from service.api.execution import OverloadedError
from service.api.inference.failures import UnsupportedError, answer_to_unsupported, failure, is_inference
from service.api.input_faults import MAX_FAULTS, InputFault, faults_of, printable, summary_of
from service.api.negotiation import NotAcceptableError
from service.api.openapi import document_of
from service.api.problems import PROBLEM_MEDIA_TYPE, PROBLEMS, Slug
from service.datasets.findings import Finding
from service.datasets.report import RejectedDatasetError
from service.errors import (
    CheckpointError,
    DatasetError,
    IdempotencyKeyError,
    InvalidValueError,
    JobNotFoundError,
    JobStateError,
    JobsUnavailableError,
    QueueFullError,
    RoverTwinError,
)
from service.learning.domain import DomainVerdict

_log = structlog.get_logger(__name__)


class InvalidInputError(RoverTwinError):
    """Fields of a request are wrong in a way that their types alone do not show."""

    def __init__(self, *faults: InputFault) -> None:
        self.faults = list(faults)
        super().__init__(summary_of(faults))


class OutsideDomainError(RoverTwinError):
    """A strict request is outside the domain of the model that would answer."""

    def __init__(self, model: str, verdict: DomainVerdict) -> None:
        self.verdict = verdict
        reasons = "; ".join(reason.detail for reason in verdict.reasons)
        super().__init__(f"the scenario is outside the domain of {model}: {reasons}")


class NotReadyError(RoverTwinError):
    """The default model cannot predict now."""


class UnsupportedMediaTypeError(RoverTwinError):
    """A body came that does not say it is JSON."""


class AdminOffError(RoverTwinError):
    """An admin address was asked for, and no token is configured: then nobody may."""

    def __init__(self) -> None:
        super().__init__("the admin endpoints are off: ROVER_TWIN_ADMIN_TOKEN is not set")


class UnauthorizedError(RoverTwinError):
    """The admin token is missing, or (`wrong`) another one was sent."""

    def __init__(self, message: str, *, wrong: bool) -> None:
        self.challenge = 'Bearer realm="rover-twin"' + (', error="invalid_token"' if wrong else "")
        super().__init__(message)


class MalformedUploadError(RoverTwinError):
    """The body of an upload cannot be taken apart, or ends before it should."""


class UploadStalledError(RoverTwinError):
    """An upload stopped coming in."""


class DatasetInUseError(RoverTwinError):
    """A dataset cannot be deleted: `versions` (name@number) and unfinished `jobs` (ids) name it."""

    def __init__(self, dataset: str, versions: Sequence[str], jobs: Sequence[str]) -> None:
        self.versions, self.jobs = list(versions), list(jobs)
        users = [f"version {each}" for each in versions[:5]] + [f"training job {each}" for each in jobs[:5]]
        more = len(self.versions) + len(self.jobs) - len(users)
        super().__init__(f"dataset {dataset} is named by {', '.join(users)}" + (f" and {more} more" if more else ""))


class PreconditionFailedError(RoverTwinError):
    """What `If-Match` or `If-None-Match` demands does not hold (any more)."""


class PreconditionRequiredError(RoverTwinError):
    """A change of something that others may change too came without `If-Match`."""


class BodyTooLargeError(HTTPException):
    """A request body is over the limit. A child of HTTPException: FastAPI hides all others that occur on reading."""

    def __init__(self, limit_bytes: int) -> None:
        super().__init__(413, f"the request body has more than {limit_bytes} bytes, which is the limit")


# From the specific to the general: the first class that fits decides.
_SLUGS: tuple[tuple[type[Exception], Slug], ...] = (
    (InvalidInputError, Slug.INVALID_INPUT),
    (InvalidValueError, Slug.INVALID_INPUT),
    (OutsideDomainError, Slug.OUTSIDE_DOMAIN),
    (NotReadyError, Slug.NOT_READY),
    (UnsupportedMediaTypeError, Slug.UNSUPPORTED_MEDIA_TYPE),
    (NotAcceptableError, Slug.NOT_ACCEPTABLE),
    (OverloadedError, Slug.OVERLOADED),
    (AdminOffError, Slug.ADMIN_OFF),
    (UnauthorizedError, Slug.UNAUTHORIZED),
    (MalformedUploadError, Slug.MALFORMED_BODY),
    (UploadStalledError, Slug.UPLOAD_STALLED),
    (DatasetInUseError, Slug.DATASET_IN_USE),
    (PreconditionFailedError, Slug.PRECONDITION_FAILED),
    (PreconditionRequiredError, Slug.PRECONDITION_REQUIRED),
    (ConflictError, Slug.CONFLICT),
    (JobNotFoundError, Slug.JOB_NOT_FOUND),
    (JobStateError, Slug.JOB_ENDED),
    (QueueFullError, Slug.QUEUE_FULL),
    (IdempotencyKeyError, Slug.IDEMPOTENCY_KEY_REUSED),
    (JobsUnavailableError, Slug.JOBS_UNAVAILABLE),
    (AlreadyExistsError, Slug.CONFLICT),
    (InvalidDraftError, Slug.DATASET_REJECTED),
    (DatasetError, Slug.DATASET_REJECTED),
    (DatasetNotFoundError, Slug.DATASET_NOT_FOUND),
    (ModelNotFoundError, Slug.MODEL_NOT_FOUND),
    (VersionNotFoundError, Slug.VERSION_NOT_FOUND),
    (AliasNotFoundError, Slug.ALIAS_NOT_FOUND),
    (NotFoundError, Slug.NOT_FOUND),
    (CorruptArtefactError, Slug.ARTEFACT_CORRUPT),
    (CheckpointError, Slug.ARTEFACT_CORRUPT),
    (UnsupportedFormatError, Slug.UNSUPPORTED_FORMAT),
    (StoreUnavailableError, Slug.STORE_UNAVAILABLE),
)
_HTTP_SLUGS = {
    400: Slug.MALFORMED_BODY,
    404: Slug.NOT_FOUND,
    405: Slug.METHOD_NOT_ALLOWED,
    413: Slug.BODY_TOO_LARGE,
    415: Slug.UNSUPPORTED_MEDIA_TYPE,
}
_RETRY_LATER = frozenset({Slug.OVERLOADED, Slug.NOT_READY, Slug.STORE_UNAVAILABLE, Slug.JOBS_UNAVAILABLE})
_HANG_UP = frozenset({Slug.BODY_TOO_LARGE, Slug.UPLOAD_STALLED})
# where the store is and what its backend said is the operator's business: log it, do not tell
_STORE_DOWN = "the model store does not answer"
_JOBS_DOWN = "the database of the training jobs does not answer"


def install(app: FastAPI) -> None:
    """Let every error that a route raises become a problem."""
    for kind in (RequestValidationError, HTTPException, RoverTwinError, StoreError):
        app.add_exception_handler(kind, _handle)


async def _handle(request: Request, error: Exception) -> Response:
    if isinstance(error, HTTPException) and error.status_code == 405:
        error = HTTPException(405, headers={"Allow": _methods_of(request)})
    return answer_to(error, own_path(request.scope))


def own_path(scope: Scope) -> str:
    """The address within this service: without the prefix under which a proxy shows it."""
    path: str = scope["path"]
    return path.removeprefix(scope.get("root_path", ""))


def _methods_of(request: Request) -> str:
    """All methods of the address; the router itself names those of one route only."""
    path = getattr(request.scope.get("route"), "path", "")
    methods = document_of(request.app)["paths"].get(path, {"get": {}})
    return ", ".join(sorted(method.upper() for method in methods))


def answer_to(error: Exception, path: str) -> Response:
    """The problem that answers a request to `path` that ended in `error`. What nobody foresaw is logged in full."""
    if isinstance(error, RequestValidationError):
        return _answer_to_validation(error, path)
    if isinstance(error, HTTPException):
        return _answer_to_http(error, path)
    if isinstance(error, UnsupportedError):
        return answer_to_unsupported(error)
    slug = next((slug for kind, slug in _SLUGS if isinstance(error, kind)), Slug.INTERNAL)
    if slug is Slug.INTERNAL:
        _log.error("a request failed", path=path[:200], exc_info=error)
        return problem(slug, "the service failed on this request; its log says why", path)
    if slug is Slug.STORE_UNAVAILABLE:
        _log.error("the store is unavailable", reason=str(error))
        return problem(slug, _STORE_DOWN, path)
    if slug is Slug.JOBS_UNAVAILABLE:
        _log.error("the training jobs are unavailable", reason=str(error))
        return problem(slug, _JOBS_DOWN, path)
    return problem(slug, str(error), path, dict(_members_of(error)), dict(_headers_of(error)))


def problem(
    slug: Slug, detail: str, path: str, members: dict[str, Any] | None = None, headers: dict[str, str] | None = None
) -> Response:
    """An RFC 9457 answer. `error` repeats the detail for clients of the Open Inference Protocol."""
    kind = PROBLEMS[slug]
    detail = printable(detail)
    document = {
        "type": kind.type,
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        "instance": quote(path[:200], safe="/:@!$&'()*+,;=~-._"),
        "error": detail,
        **(members or {}),
    }
    headers = dict(headers or {}) | ({"Retry-After": "1"} if slug in _RETRY_LATER else {})
    if slug in _HANG_UP:
        headers["Connection"] = "close"  # the rest of the body is not worth reading
    if is_inference(path):
        return failure(slug, detail, headers)
    return Response(orjson.dumps(document), kind.status, headers, PROBLEM_MEDIA_TYPE)


def _rejection(finding: Finding) -> InputFault:
    # its place is in the message, and apart in `report`
    return InputFault("file", finding.file, f"no {finding.code}", str(finding))


def _headers_of(error: Exception) -> Iterator[tuple[str, str]]:
    if isinstance(error, UnauthorizedError):
        yield "WWW-Authenticate", error.challenge
    elif isinstance(error, QueueFullError):
        yield "Retry-After", str(error.retry_after_s)


def _members_of(error: Exception) -> Iterator[tuple[str, Any]]:
    if isinstance(error, InvalidInputError):
        yield "errors", [fault.as_json() for fault in error.faults]
    elif isinstance(error, InvalidValueError):
        yield "errors", [InputFault(error.field, error.value, error.allowed, str(error)).as_json()]
    elif isinstance(error, RejectedDatasetError):
        yield "report", report_document(error.report)
        yield "errors", [_rejection(each).as_json() for each in error.report.rejections[:MAX_FAULTS]]
    elif isinstance(error, DatasetInUseError):
        yield "used_by", {"versions": error.versions[:100], "jobs": error.jobs[:100]}
    elif isinstance(error, OutsideDomainError):
        yield "domain", domain_document(error.verdict)
        yield (
            "errors",
            [
                InputFault(
                    reason.field, reason.value, f"{reason.lowest:.6g} to {reason.highest:.6g}", reason.detail
                ).as_json()
                for reason in error.verdict.reasons
            ],
        )


def _answer_to_validation(error: RequestValidationError, path: str) -> Response:
    errors = error.errors()
    if errors[0]["type"] == "json_invalid":
        return problem(Slug.MALFORMED_BODY, f"the body cannot be read as JSON: {errors[0]['ctx']['error']}", path)
    if errors[0]["type"] == "missing" and errors[0]["loc"] == ("body",):
        return problem(Slug.MALFORMED_BODY, "the body is empty; send a JSON object", path)
    faults = faults_of(errors)
    return problem(Slug.INVALID_INPUT, summary_of(faults), path, {"errors": [each.as_json() for each in faults]})


def _answer_to_http(error: HTTPException, path: str) -> Response:
    slug = _HTTP_SLUGS.get(error.status_code, Slug.INTERNAL)
    headers = dict(error.headers or {})
    if slug is Slug.NOT_FOUND:
        detail = "there is no such address; /docs lists those there are"
    elif slug is Slug.METHOD_NOT_ALLOWED:
        detail = f"this address does not take that method; it takes {headers.get('Allow', 'GET')}"
    elif slug is Slug.MALFORMED_BODY:
        cause = error.__cause__ or error.detail
        reason = "it is nested too deeply" if isinstance(cause, RecursionError) else str(cause)[:200]
        detail = f"the body cannot be read: {reason}"
    elif slug is Slug.INTERNAL:
        _log.error("a request failed", path=path[:200], exc_info=error)
        detail = "the service failed on this request; its log says why"
    else:
        detail = error.detail
    return problem(slug, detail, path, headers=headers)
