"""From what went wrong to the answer: the only place that turns exceptions into problems."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

import orjson
import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import Scope

from model_store import (
    AliasNotFoundError,
    AlreadyExistsError,
    ConflictError,
    CorruptArtefactError,
    DatasetNameTakenError,
    DatasetNotFoundError,
    InvalidDraftError,
    ModelNotFoundError,
    NotFoundError,
    StoreError,
    StoreFullError,
    StoreUnavailableError,
    UnsupportedFormatError,
    VersionArchivedError,
    VersionDeletedError,
    VersionInUseError,
    VersionNotFoundError,
)
from service.api.http.answers.negotiation import NotAcceptableError
from service.api.http.exceptions import (
    AdminOffError,
    ForbiddenError,
    HeadTooLargeError,
    HeadTooSlowError,
    MalformedHeadError,
    MalformedUploadError,
    NotReadyError,
    PreconditionFailedError,
    PreconditionRequiredError,
    RepeatedHeaderError,
    TooManyAttemptsError,
    UnauthorizedError,
    UnsupportedMediaTypeError,
    UploadStalledError,
)
from service.api.http.limits.worker_threads import ClientGoneError, OverloadedError
from service.api.http.problems import PROBLEM_MEDIA_TYPE, PROBLEMS, Slug
from service.datasets.file_names import printable
from service.datasets.findings import Finding
from service.datasets.report import RejectedDatasetError
from service.errors import (
    AuditUnavailableError,
    CheckpointError,
    DatasetError,
    DatasetInUseError,
    IdempotencyKeyError,
    InvalidValueError,
    JobNotFoundError,
    JobStateError,
    JobsUnavailableError,
    MissingPartError,
    QueueFullError,
    RoverTwinError,
    StorageFullError,
)
from service.twin import OutsideDomainError
from service.wire.datasets import report_document
from service.wire.faults import MAX_FAULTS, InputFault, InvalidInputError, MalformedBodyError, faults_of, summary_of
from service.wire.forms.subject import domain_document
from service.wire.prediction import ALLOWED

_log = structlog.get_logger(__name__)


# From the specific to the general: the first class that fits decides.
_SLUGS: tuple[tuple[type[Exception], Slug], ...] = (
    (InvalidInputError, Slug.INVALID_INPUT),
    (InvalidValueError, Slug.INVALID_INPUT),
    (OutsideDomainError, Slug.OUTSIDE_DOMAIN),
    (NotReadyError, Slug.NOT_READY),
    (UnsupportedMediaTypeError, Slug.UNSUPPORTED_MEDIA_TYPE),
    (NotAcceptableError, Slug.NOT_ACCEPTABLE),
    (OverloadedError, Slug.OVERLOADED),
    (ClientGoneError, Slug.CLIENT_GONE),
    (ClientDisconnect, Slug.CLIENT_GONE),
    (AdminOffError, Slug.ADMIN_OFF),
    (UnauthorizedError, Slug.UNAUTHORIZED),
    (ForbiddenError, Slug.INSUFFICIENT_SCOPE),
    (TooManyAttemptsError, Slug.TOO_MANY_ATTEMPTS),
    (AuditUnavailableError, Slug.AUDIT_UNAVAILABLE),
    (MalformedBodyError, Slug.MALFORMED_BODY),
    (MalformedUploadError, Slug.MALFORMED_BODY),
    (UploadStalledError, Slug.UPLOAD_STALLED),
    (HeadTooLargeError, Slug.HEAD_TOO_LARGE),
    (HeadTooSlowError, Slug.HEAD_TOO_SLOW),
    (MalformedHeadError, Slug.MALFORMED_HEAD),
    (RepeatedHeaderError, Slug.MALFORMED_HEAD),
    (DatasetInUseError, Slug.DATASET_IN_USE),
    (PreconditionFailedError, Slug.PRECONDITION_FAILED),
    (PreconditionRequiredError, Slug.PRECONDITION_REQUIRED),
    (VersionInUseError, Slug.VERSION_IN_USE),
    (VersionArchivedError, Slug.VERSION_ARCHIVED),
    (VersionDeletedError, Slug.VERSION_DELETED),
    (DatasetNameTakenError, Slug.DATASET_NAME_TAKEN),
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
    (MissingPartError, Slug.NOT_INSTALLED),
    (UnsupportedFormatError, Slug.UNSUPPORTED_FORMAT),
    (StoreFullError, Slug.STORAGE_FULL),
    (StorageFullError, Slug.STORAGE_FULL),
    (StoreUnavailableError, Slug.STORE_UNAVAILABLE),
)
_HTTP_SLUGS = {
    400: Slug.MALFORMED_BODY,
    404: Slug.NOT_FOUND,
    405: Slug.METHOD_NOT_ALLOWED,
    413: Slug.BODY_TOO_LARGE,
    415: Slug.UNSUPPORTED_MEDIA_TYPE,
    426: Slug.UPGRADE_REQUIRED,
}
_RETRY_LATER = frozenset(
    {Slug.OVERLOADED, Slug.NOT_READY, Slug.STORE_UNAVAILABLE, Slug.JOBS_UNAVAILABLE, Slug.AUDIT_UNAVAILABLE}
)
_HANG_UP = frozenset({Slug.BODY_TOO_LARGE, Slug.UPLOAD_STALLED, Slug.STORAGE_FULL})
# where the store is and what its backend said is the operator's business: log it, do not tell
_STORE_DOWN = "the model store does not answer"
_JOBS_DOWN = "the database of the training jobs does not answer"
_AUDIT_DOWN = "the audit log does not answer, and without it nothing is changed"
_FULL = "there is no room left for what was sent; nothing of it was kept"
_FAILED = "the service failed on this request; its log says why"


@dataclass(frozen=True, slots=True)
class Told:
    """What an answer tells of an error: the kind of problem, one line, and the members and headers of its own."""

    slug: Slug
    detail: str
    members: Mapping[str, Any] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)


Form = Callable[[Exception, Callable[[Exception], Told]], Response]
"""An error form of its own: makes the answer to an error, with what there is to tell of it if it asks."""


class ErrorAnswers:
    """From an error to its answer: a problem, or under one of the prefixes in `forms` what that form makes of it."""

    def __init__(self, forms: Mapping[str, Form]) -> None:
        self._forms = dict(forms)

    def __call__(self, error: Exception, path: str) -> Response:
        """The answer to a request to `path` that ended in `error`. What nobody foresaw is logged in full."""
        for prefix, form in self._forms.items():
            if path == prefix or path.startswith(prefix + "/"):
                return form(error, told)
        return problem(told(error), path)

    def install(self, app: FastAPI) -> None:
        """Let every error that a route raises be answered so."""
        for kind in (RequestValidationError, HTTPException, RoverTwinError, StoreError):
            app.add_exception_handler(kind, self._handle)

    async def _handle(self, request: Request, error: Exception) -> Response:
        if isinstance(error, HTTPException) and error.status_code == 405:
            error = HTTPException(405, headers={"Allow": _methods_of(request)})
        return self(error, own_path(request.scope))


def own_path(scope: Scope) -> str:
    """The address within this service: without the prefix under which a proxy shows it."""
    path: str = scope["path"]
    return path.removeprefix(scope.get("root_path", ""))


def _methods_of(request: Request) -> str:
    """All methods of the address; the router itself names those of one route only."""
    path = getattr(request.scope.get("route"), "path", "")
    routes = [each for each in request.app.routes if getattr(each, "path", None) == path]
    methods = {method for each in routes for method in getattr(each, "methods", None) or ()} or {"GET"}
    return ", ".join(sorted(methods | {"HEAD"} if "GET" in methods else methods))


def told(error: Exception) -> Told:
    """What an answer tells of an error. What nobody foresaw is logged in full."""
    if isinstance(error, RequestValidationError):
        return _of_validation(error)
    if isinstance(error, HTTPException):
        return _of_http(error)
    slug = next((slug for kind, slug in _SLUGS if isinstance(error, kind)), Slug.INTERNAL)
    if slug is Slug.INTERNAL:
        _log.error("a request failed", exc_info=error)
        return _tell(slug, _FAILED)
    if slug is Slug.STORAGE_FULL:
        _log.error("the storage is full", reason=str(error))
        return _tell(slug, _FULL)
    if slug is Slug.STORE_UNAVAILABLE:
        _log.error("the store is unavailable", reason=str(error))
        return _tell(slug, _STORE_DOWN)
    if slug is Slug.JOBS_UNAVAILABLE:
        _log.error("the training jobs are unavailable", reason=str(error))
        return _tell(slug, _JOBS_DOWN)
    if slug is Slug.AUDIT_UNAVAILABLE:
        _log.error("the audit log is unavailable", reason=str(error))
        return _tell(slug, _AUDIT_DOWN)
    if slug is Slug.CLIENT_GONE:
        return _tell(slug, "the client hung up")
    return _tell(slug, str(error), dict(_members_of(error)), dict(_headers_of(error)))


def _tell(
    slug: Slug, detail: str, members: Mapping[str, Any] | None = None, headers: Mapping[str, str] | None = None
) -> Told:
    common = {"Retry-After": "1"} if slug in _RETRY_LATER else {}
    if slug in _HANG_UP:
        common["Connection"] = "close"  # the rest of the body is not worth reading
    return Told(slug, printable(detail), members or {}, {**(headers or {}), **common})


def problem(told: Told, path: str) -> Response:
    """An RFC 9457 answer. `error` repeats the detail for clients of the Open Inference Protocol."""
    instance = {"instance": quote(path[:200], safe="/:@!$&'()*+,;=~-._"), "error": told.detail}
    kind = PROBLEMS[told.slug]
    content = orjson.dumps({**problem_members(told), **instance, **told.members})
    return Response(content, kind.status, dict(told.headers), PROBLEM_MEDIA_TYPE)


def problem_members(told: Told) -> dict[str, Any]:
    """A problem without what only a whole answer has."""
    kind = PROBLEMS[told.slug]
    return {"type": kind.type, "title": kind.title, "status": kind.status, "detail": told.detail}


def _rejection(finding: Finding) -> InputFault:
    # its place is in the message, and apart in `report`
    return InputFault("file", finding.file, f"no {finding.code}", str(finding))


def _headers_of(error: Exception) -> Iterator[tuple[str, str]]:
    if isinstance(error, UnauthorizedError | ForbiddenError):
        yield "WWW-Authenticate", error.challenge
    elif isinstance(error, QueueFullError | TooManyAttemptsError):
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
    elif isinstance(error, VersionInUseError):
        yield "aliases", error.aliases
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


def _of_validation(error: RequestValidationError) -> Told:
    errors = error.errors()
    if errors[0]["type"] == "json_invalid":
        return _tell(Slug.MALFORMED_BODY, f"the body cannot be read as JSON: {errors[0]['ctx']['error']}")
    if errors[0]["type"] == "missing" and errors[0]["loc"] == ("body",):
        return _tell(Slug.MALFORMED_BODY, "the body is empty; send a JSON object")
    faults = faults_of(errors, ALLOWED)
    return _tell(Slug.INVALID_INPUT, summary_of(faults), {"errors": [each.as_json() for each in faults]})


def _of_http(error: HTTPException) -> Told:
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
        _log.error("a request failed", exc_info=error)
        detail = _FAILED
    else:
        detail = error.detail
    return _tell(slug, detail, headers=headers)
