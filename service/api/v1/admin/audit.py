"""`/v1/admin/audit`: who changed what, or tried to, and from where. Only for tokens of scope admin."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated
from urllib.parse import urlencode

from fastapi import Query
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from service.access.token_file import NAME_PATTERN
from service.api.admin import ADMIN_PROBLEMS, Admin, SecretRoute, audit_call
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.router import Router
from service.api.services import TheServices
from service.errors import AuditUnavailableError
from service.jobs.audit import MOST_LISTED, AuditEntry
from service.wire.whole_numbers import PLAIN_INTEGER

ADDRESS = "/v1/admin/audit"
_HIGHEST = 2**63 - 1
_MOMENT = {"x-allowed": "a time such as 2026-11-28T09:00:00Z"}

router = Router(
    prefix=ADDRESS,
    tags=["audit"],
    route_class=SecretRoute,
    responses=problem_responses(*ADMIN_PROBLEMS, Slug.OVERLOADED),
)


class AuditQuery(BaseModel):
    """Which rows to list."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    actor: Annotated[
        str | SkipJsonSchema[None],
        Field(
            pattern=NAME_PATTERN,
            description="Only calls by this token.",
            examples=["ada"],
            json_schema_extra={
                "x-allowed": "the name of a token: 1 to 63 of A-Z a-z 0-9 . _ @ + -, starting with a letter or digit"
            },
        ),
    ] = None
    since: Annotated[
        datetime | SkipJsonSchema[None],
        Field(description="Only calls at this time or later, UTC if no offset is given.", json_schema_extra=_MOMENT),
    ] = None
    until: Annotated[
        datetime | SkipJsonSchema[None],
        Field(description="Only calls before this time.", json_schema_extra=_MOMENT),
    ] = None
    limit: Annotated[
        int,
        Field(ge=1, le=MOST_LISTED, description="Most rows on a page.", examples=[50]),
        PLAIN_INTEGER,
    ] = 50
    before: Annotated[
        int | SkipJsonSchema[None],
        Field(
            ge=1,
            le=_HIGHEST,
            description="Only rows older than the one with this id; `next` of a page has it.",
            json_schema_extra={"x-allowed": f"a whole number from 1 to {_HIGHEST}"},
        ),
        PLAIN_INTEGER,
    ] = None


class AuditRow(BaseModel):
    """One call."""

    id: int
    at: Annotated[datetime, Field(description="When it came, UTC.")]
    actor: Annotated[str, Field(description="Name of the token.")]
    client: Annotated[str, Field(description="Address of the client, behind trusted proxies too.")]
    method: str
    route: Annotated[str, Field(description="Template of the address.", examples=["/v1/admin/datasets/{dataset}"])]
    path: Annotated[str, Field(description="The address as it was asked for, percent-encoded, without its query.")]
    status: Annotated[
        int | None,
        Field(
            description="What was answered; null while the call runs, for one whose process died meanwhile, and where "
            "the audit log did not answer at its end. 499: the client hung up."
        ),
    ]
    subject: Annotated[
        str | None,
        Field(
            description="What it was about, where a call came that far: version, alias, dataset or job.",
            examples=["viper-lunar@champion -> 3"],
        ),
    ]
    request_id: Annotated[str, Field(description="The `X-Request-ID` of the answer, and of the lines in the log.")]

    @classmethod
    def of(cls, entry: AuditEntry) -> AuditRow:
        """The row of an entry."""
        return cls.model_validate(entry, from_attributes=True)


class AuditAnswer(BaseModel):
    """One page, newest first; `next` is the address of the page after it."""

    entries: list[AuditRow]
    next: str | None = None


@router.get("", summary="The audit log")
async def list_audit_entries(asked: Annotated[AuditQuery, Query()], _: Admin, services: TheServices) -> AuditAnswer:
    """Every call that could change something, of callers whose token allowed it, with what was answered."""
    audit = services.audit
    if audit is None:
        raise AuditUnavailableError("this service was started without a database")
    found = await audit_call(
        services,
        lambda: audit.page(
            limit=asked.limit + 1, before=asked.before, actor=asked.actor, since=asked.since, until=asked.until
        ),
    )
    shown = found[: asked.limit]
    more = _next(asked, shown[-1].id) if len(found) > len(shown) else None
    return AuditAnswer(entries=[AuditRow.of(each) for each in shown], next=more)


def _next(asked: AuditQuery, last: int) -> str:
    said = {"actor": asked.actor, "since": _utc(asked.since), "until": _utc(asked.until), "limit": asked.limit}
    return (
        f"{ADDRESS}?{urlencode({name: value for name, value in said.items() if value is not None} | {'before': last})}"
    )


def _utc(moment: datetime | None) -> str | None:
    if moment is None:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).isoformat()
