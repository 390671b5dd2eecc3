"""The closed table of problems: every error answer is one of these. `type` is stable, the words may improve."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from pydantic import BaseModel, Field

from service.wire.datasets import DatasetUsers, ReportAnswer
from service.wire.faults import ProblemError
from service.wire.prediction_answer import DomainAnswer

PROBLEM_MEDIA_TYPE = "application/problem+json"
_TYPE_PREFIX = "urn:rover-twin:problem:"


class Slug(StrEnum):
    """Short name of a problem, the end of its `type`."""

    INVALID_INPUT = "invalid-input"
    OUTSIDE_DOMAIN = "outside-domain"
    MALFORMED_BODY = "malformed-body"
    UNSUPPORTED_MEDIA_TYPE = "unsupported-media-type"
    BODY_TOO_LARGE = "body-too-large"
    HEAD_TOO_LARGE = "head-too-large"
    HEAD_TOO_SLOW = "head-too-slow"
    MALFORMED_HEAD = "malformed-head"
    CLIENT_GONE = "client-gone"
    NOT_ACCEPTABLE = "not-acceptable"
    NOT_FOUND = "not-found"
    MODEL_NOT_FOUND = "model-not-found"
    VERSION_NOT_FOUND = "version-not-found"
    VERSION_ARCHIVED = "version-archived"
    VERSION_DELETED = "version-deleted"
    VERSION_IN_USE = "version-in-use"
    ALIAS_NOT_FOUND = "alias-not-found"
    DATASET_NOT_FOUND = "dataset-not-found"
    METHOD_NOT_ALLOWED = "method-not-allowed"
    UPGRADE_REQUIRED = "upgrade-required"
    UNAUTHORIZED = "unauthorized"
    INSUFFICIENT_SCOPE = "insufficient-scope"
    TOO_MANY_ATTEMPTS = "too-many-attempts"
    ADMIN_OFF = "admin-off"
    DATASET_REJECTED = "dataset-rejected"
    DATASET_IN_USE = "dataset-in-use"
    DATASET_NAME_TAKEN = "dataset-name-taken"
    UPLOAD_STALLED = "upload-stalled"
    CONFLICT = "conflict"
    JOB_NOT_FOUND = "job-not-found"
    JOB_ENDED = "job-ended"
    QUEUE_FULL = "queue-full"
    IDEMPOTENCY_KEY_REUSED = "idempotency-key-reused"
    JOBS_UNAVAILABLE = "jobs-unavailable"
    AUDIT_UNAVAILABLE = "audit-unavailable"
    PRECONDITION_FAILED = "precondition-failed"
    PRECONDITION_REQUIRED = "precondition-required"
    ARTEFACT_CORRUPT = "artefact-corrupt"
    UNSUPPORTED_FORMAT = "unsupported-format"
    STORE_UNAVAILABLE = "store-unavailable"
    STORAGE_FULL = "storage-full"
    NOT_READY = "not-ready"
    OVERLOADED = "overloaded"
    NOT_INSTALLED = "not-installed"
    INTERNAL = "internal"


@dataclass(frozen=True, slots=True)
class ProblemKind:
    """One row of the table: what happened in general, and what the caller can do about it."""

    slug: Slug
    status: int
    title: str
    meaning: str

    @property
    def type(self) -> str:
        """The URI that identifies the problem."""
        return _TYPE_PREFIX + self.slug


_ROWS = (
    ProblemKind(
        Slug.INVALID_INPUT,
        422,
        "Invalid input",
        "A field is missing, unknown, of the wrong kind or out of range; `errors` names each with what is allowed.",
    ),
    ProblemKind(
        Slug.OUTSIDE_DOMAIN,
        422,
        "Outside the model's domain",
        "`strict=true` was asked for and no training run is near the scenario; ask without it to get a verdict.",
    ),
    ProblemKind(Slug.MALFORMED_BODY, 400, "Malformed body", "The request body is not JSON; send one JSON object."),
    ProblemKind(
        Slug.UNSUPPORTED_MEDIA_TYPE,
        415,
        "Unsupported media type",
        "The request body is of another kind; send `Content-Type: application/json`.",
    ),
    ProblemKind(Slug.BODY_TOO_LARGE, 413, "Body too large", "The request body is over the limit; send a smaller one."),
    ProblemKind(
        Slug.HEAD_TOO_LARGE,
        431,
        "Request header fields too large",
        "The address and the headers are over the limit; send fewer or shorter ones.",
    ),
    ProblemKind(
        Slug.HEAD_TOO_SLOW, 408, "Request timeout", "The head of the request did not come in time; send it at once."
    ),
    ProblemKind(
        Slug.MALFORMED_HEAD,
        400,
        "Malformed request",
        "What came is no HTTP request, or has a header several times that may come once.",
    ),
    ProblemKind(
        Slug.CLIENT_GONE,
        499,
        "Client closed request",
        "The client hung up before it was answered. Only the log, the metrics and the audit log ever show this.",
    ),
    ProblemKind(
        Slug.NOT_ACCEPTABLE,
        406,
        "Not acceptable",
        "No format that `Accept` lists is available; ask for one that is, or use `format`.",
    ),
    ProblemKind(Slug.NOT_FOUND, 404, "Not found", "There is no such address; `/docs` lists those there are."),
    ProblemKind(Slug.MODEL_NOT_FOUND, 404, "Model not found", "`GET /v1/models` lists the models there are."),
    ProblemKind(
        Slug.VERSION_NOT_FOUND, 404, "Version not found", "`GET /v1/models/{name}` lists the versions of a model."
    ),
    ProblemKind(
        Slug.VERSION_ARCHIVED,
        409,
        "Version archived",
        "The version is out of use: ask for another one, or let the operator restore it.",
    ),
    ProblemKind(
        Slug.VERSION_DELETED,
        410,
        "Version deleted",
        "The version's weights are gone for good; its manifest stays. Ask for another version.",
    ),
    ProblemKind(
        Slug.VERSION_IN_USE,
        409,
        "Version in use",
        "Aliases name the version (`aliases` lists them), or it is the default model: point them elsewhere first.",
    ),
    ProblemKind(
        Slug.ALIAS_NOT_FOUND, 404, "Alias not found", "`GET /v1/models/{name}/aliases` lists the aliases of a model."
    ),
    ProblemKind(
        Slug.DATASET_NOT_FOUND, 404, "Dataset not found", "`GET /v1/admin/datasets` lists the datasets there are."
    ),
    ProblemKind(
        Slug.UNAUTHORIZED,
        401,
        "Unauthorized",
        "The address needs a token; send `Authorization: Bearer <token>`.",
    ),
    ProblemKind(
        Slug.INSUFFICIENT_SCOPE,
        403,
        "Insufficient scope",
        "The token may only read, and this changes something or shows who changed something; send one of scope admin.",
    ),
    ProblemKind(
        Slug.TOO_MANY_ATTEMPTS,
        429,
        "Too many attempts",
        "Wrong tokens keep coming from this address. The right one is let in at once; others wait `Retry-After` s.",
    ),
    ProblemKind(
        Slug.ADMIN_OFF,
        403,
        "Admin endpoints off",
        "No token is configured; the operator sets `ROVER_TWIN_ADMIN_TOKEN` or `ROVER_TWIN_TOKENS_FILE` to switch "
        "these addresses on.",
    ),
    ProblemKind(
        Slug.DATASET_REJECTED,
        422,
        "Dataset rejected",
        "No run of the upload is usable, or `strict` was set and some run is not. "
        "`report` names file, row, column and reason.",
    ),
    ProblemKind(
        Slug.DATASET_IN_USE,
        409,
        "Dataset in use",
        "A published version or an unfinished training job names the dataset; `used_by` lists them.",
    ),
    ProblemKind(
        Slug.DATASET_NAME_TAKEN,
        409,
        "Dataset name taken",
        "Another dataset is found by that name, so nothing was stored: choose another name, or take that one from it "
        "with `DELETE /v1/admin/datasets/{dataset}/names/{name}`.",
    ),
    ProblemKind(
        Slug.UPLOAD_STALLED, 408, "Upload stalled", "No byte of the body came for half a minute; send it again."
    ),
    ProblemKind(Slug.CONFLICT, 409, "Conflict", "The resource is in a state that does not allow this; see `detail`."),
    ProblemKind(
        Slug.JOB_NOT_FOUND, 404, "Training job not found", "`GET /v1/admin/training-jobs` lists the jobs there are."
    ),
    ProblemKind(
        Slug.JOB_ENDED, 409, "Training job ended", "The job has ended already: there is nothing left to cancel."
    ),
    ProblemKind(
        Slug.QUEUE_FULL,
        429,
        "Queue full",
        "The queue of training jobs is full. Try again after `Retry-After` seconds, or cancel a job.",
    ),
    ProblemKind(
        Slug.IDEMPOTENCY_KEY_REUSED,
        422,
        "Idempotency key reused",
        "The same `Idempotency-Key` came with another request before; take a new key for a new job.",
    ),
    ProblemKind(
        Slug.JOBS_UNAVAILABLE,
        503,
        "Training jobs unavailable",
        "The database of the training jobs does not answer; try again a little later. Predictions are not affected.",
    ),
    ProblemKind(
        Slug.AUDIT_UNAVAILABLE,
        503,
        "Audit log unavailable",
        "The audit log cannot be written or read now. What it would have to show was not done; try again later.",
    ),
    ProblemKind(
        Slug.PRECONDITION_FAILED,
        412,
        "Precondition failed",
        "The alias has moved since it was read: it is not what `If-Match` or `If-None-Match` says. Read it again.",
    ),
    ProblemKind(
        Slug.PRECONDITION_REQUIRED,
        428,
        "Precondition required",
        "Send `If-Match` with the `ETag` of the alias as you read it, or `*` to move it wherever it points.",
    ),
    ProblemKind(
        Slug.METHOD_NOT_ALLOWED, 405, "Method not allowed", "The `Allow` header lists the methods of this address."
    ),
    ProblemKind(
        Slug.UPGRADE_REQUIRED, 426, "Upgrade required", "The address takes no plain requests; open a WebSocket there."
    ),
    ProblemKind(
        Slug.ARTEFACT_CORRUPT,
        503,
        "Stored version unusable",
        "The stored version is damaged. The operator has to restore it; other versions still answer.",
    ),
    ProblemKind(
        Slug.UNSUPPORTED_FORMAT,
        503,
        "Stored version too new",
        "The version was published by a newer release. The operator has to upgrade this service; "
        "other versions still answer.",
    ),
    ProblemKind(
        Slug.STORE_UNAVAILABLE, 503, "Store unavailable", "The model store does not answer; try again a little later."
    ),
    ProblemKind(
        Slug.STORAGE_FULL,
        507,
        "Storage full",
        "There is no room for what was sent, and nothing of it was kept. The operator has to make room; then send it "
        "again.",
    ),
    ProblemKind(
        Slug.NOT_READY, 503, "Not ready", "The default model cannot predict now; `detail` says why. Try again later."
    ),
    ProblemKind(
        Slug.OVERLOADED,
        503,
        "Overloaded",
        "The service has as much work as it takes; `detail` says of which kind. Try again after `Retry-After` seconds.",
    ),
    ProblemKind(
        Slug.NOT_INSTALLED,
        501,
        "Not installed here",
        "A library is needed that this installation does without: the serving image has no pictures and no "
        "training. `detail` says which; ask a service that runs the whole image.",
    ),
    ProblemKind(
        Slug.INTERNAL, 500, "Internal error", "A fault of the service; report it with the `X-Request-ID` of the answer."
    ),
)

PROBLEMS = {row.slug: row for row in _ROWS}


class Problem(BaseModel):
    """An RFC 9457 problem."""

    type: Annotated[str, Field(description="Stable URI of the kind of problem.", pattern="^urn:rover-twin:problem:")]
    title: str
    status: int
    detail: Annotated[str, Field(description="What happened here, in one line.")]
    instance: Annotated[str, Field(description="Path of the request.")]
    errors: Annotated[
        list[ProblemError], Field(description="Only with invalid-input, outside-domain and dataset-rejected.")
    ] = []
    domain: Annotated[DomainAnswer | None, Field(description="Only with outside-domain.")] = None
    report: Annotated[ReportAnswer | None, Field(description="Only with dataset-rejected.")] = None
    used_by: Annotated[DatasetUsers | None, Field(description="Only with dataset-in-use.")] = None
    aliases: Annotated[list[str] | None, Field(description="Only with version-in-use.")] = None
    error: Annotated[str, Field(description="The same text as `detail`.")]
