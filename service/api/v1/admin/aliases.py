"""`/v1/models/{name}/aliases`: where aliases point and how they got there; to move one or to take a move back.

Two people who move one alias at once must not overwrite each other unseen: a move names, by `If-Match`, the record
that it has looked at. The records themselves are the audit trail.
"""

from __future__ import annotations

import re
from datetime import datetime
from typing import Annotated

from fastapi import Body, Header, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from model_store import AliasNotFoundError, AliasRecord, ConflictError, CorruptArtefactError, ModelStore, layout
from service.api.admin import ADMIN_PROBLEMS, Admin, AdminRoute, about
from service.api.http.exceptions import PreconditionFailedError, PreconditionRequiredError
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import TheServices
from service.api.v1.models import MODEL_PROBLEMS, Alias, Name, require_name
from service.wire.faults import InvalidInputError, fault

ANY = "*"
_TAG = re.compile(r'\s*(W/)?"([^"]*)"\s*')
_ETAG = {"ETag": {"schema": {"type": "string"}, "description": "Number of the move in quotes, for `If-Match`."}}
_NO_MODEL = problem_responses(Slug.MODEL_NOT_FOUND)
_NO_ALIAS = problem_responses(Slug.MODEL_NOT_FOUND, Slug.ALIAS_NOT_FOUND)
_WRITE_PROBLEMS = (
    *ADMIN_PROBLEMS,
    Slug.MODEL_NOT_FOUND,
    Slug.VERSION_NOT_FOUND,
    Slug.VERSION_ARCHIVED,
    Slug.VERSION_DELETED,
    Slug.MALFORMED_BODY,
    Slug.UNSUPPORTED_MEDIA_TYPE,
    Slug.BODY_TOO_LARGE,
    Slug.STORAGE_FULL,
    Slug.PRECONDITION_FAILED,
)

Reason = Annotated[str, Field(max_length=4000, description="Reason of the move, kept in the history.")]


class AliasAnswer(BaseModel):
    """Where an alias points, since when, by whom and why."""

    version: int
    seq: Annotated[int, Field(ge=1, description="Number of this move; rises by one with each.")]
    time: datetime
    actor: str
    reason: str
    previous_seq: Annotated[
        int | None, Field(description="The move that a rollback from here goes back to; null when there is none.")
    ] = None


class AliasesAnswer(BaseModel):
    """All aliases of a model."""

    aliases: dict[str, AliasAnswer]


class AliasHistoryAnswer(BaseModel):
    """Every move of an alias, newest first."""

    history: list[AliasAnswer]


class AliasMove(BaseModel):
    """The version that the alias is to point to, and why."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    version: Annotated[int, Field(ge=1, le=layout.MAX_VERSION, description="A published version.", examples=[2])]
    reason: Annotated[Reason, Field(min_length=1, examples=["better on slopes above 25 degrees"])]


class AliasRollback(BaseModel):
    """Why the last move is taken back."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    reason: Reason = ""


IfMatch = Annotated[
    str | SkipJsonSchema[None],
    Header(
        description='`ETag` of the alias as it was read, such as `"3"`, or `*` for any.',
        examples=['"3"'],
    ),
]
IfNoneMatch = Annotated[
    str | SkipJsonSchema[None],
    Header(description="`*`: only if there is no such alias yet.", json_schema_extra={"enum": [ANY]}),
]

reading = Router(prefix="/v1/models", tags=["models"], responses=problem_responses(*MODEL_PROBLEMS), route_class=Route)
moving = Router(
    prefix="/v1/models", tags=["models"], responses=problem_responses(*MODEL_PROBLEMS), route_class=AdminRoute
)


@reading.get("/{name}/aliases", summary="The aliases of a model", responses=_NO_MODEL)
async def list_aliases(name: Name, services: TheServices) -> AliasesAnswer:
    """Where each alias points now."""
    require_name(name)
    records = await services.storage.run(lambda: services.store.aliases(name))
    return AliasesAnswer(aliases={alias: _answer(record) for alias, record in records.items()})


@reading.get("/{name}/aliases/{alias}", summary="One alias", responses=_NO_ALIAS | {200: {"headers": _ETAG}})
async def get_alias(name: Name, alias: Alias, services: TheServices, response: Response) -> AliasAnswer:
    """Where the alias points now. A move sends the `ETag` as `If-Match`."""
    require_name(name, alias)
    record = await services.storage.run(lambda: services.store.alias(name, alias))
    response.headers["ETag"] = etag_of(record.seq)
    return _answer(record)


@reading.get("/{name}/aliases/{alias}/history", summary="The history of an alias", responses=_NO_ALIAS)
async def list_alias_history(name: Name, alias: Alias, services: TheServices) -> AliasHistoryAnswer:
    """Every move of the alias, newest first."""
    require_name(name, alias)
    records = await services.storage.run(lambda: services.store.alias_history(name, alias))
    return AliasHistoryAnswer(history=[_answer(record) for record in reversed(records)])


@moving.put(
    "/{name}/aliases/{alias}",
    summary="Move an alias",
    responses=problem_responses(*_WRITE_PROBLEMS, Slug.PRECONDITION_REQUIRED)
    | {
        200: {"headers": _ETAG, "description": "An existing alias has moved."},
        201: {"model": AliasAnswer, "headers": _ETAG, "description": "A new alias was made."},
    },
)
async def put_alias(
    name: Name,
    alias: Alias,
    asked: Annotated[AliasMove, Body()],
    actor: Admin,
    services: TheServices,
    response: Response,
    if_match: IfMatch = None,
    if_none_match: IfNoneMatch = None,
) -> AliasAnswer:
    """Point the alias to a published version. To move an existing alias, send `If-Match`; a new one needs none.

    Moving it to its present version is a move too. Predictions follow within two seconds, over a remote store those of
    other replicas within five. A running prediction finishes on the version that it began with.
    """
    require_name(name)
    about(f"{name}@{alias} -> {asked.version}")
    if not layout.is_alias(alias):
        raise InvalidInputError(fault("alias", alias, "a-z, 0-9 and '-', starting with a letter, at most 63"))
    condition = _Condition(name, alias, if_match, if_none_match)
    try:
        moved = await services.storage.run(lambda: _move(services.store, condition, asked, actor))
    finally:
        services.registry.moved()
    response.headers["ETag"] = etag_of(moved.seq)
    response.status_code = 201 if moved.seq == 1 else 200
    return _answer(moved)


@moving.post(
    "/{name}/aliases/{alias}/rollback",
    summary="Take the last move of an alias back",
    responses=problem_responses(*_WRITE_PROBLEMS, Slug.PRECONDITION_REQUIRED, Slug.ALIAS_NOT_FOUND, Slug.CONFLICT)
    | {200: {"headers": _ETAG}},
)
async def roll_back_alias(
    name: Name,
    alias: Alias,
    actor: Admin,
    services: TheServices,
    response: Response,
    asked: Annotated[AliasRollback | SkipJsonSchema[None], Body()] = None,
    if_match: IfMatch = None,
) -> AliasAnswer:
    """Back to the version before. A second rollback goes one version further back.

    Send `If-Match`, as to move the alias; `*` takes back the last move, whichever it is. Without an earlier version it
    is a conflict.
    """
    require_name(name, alias)
    condition = _Condition(name, alias, if_match, None)
    reason = (asked or AliasRollback()).reason
    try:
        back = await services.storage.run(lambda: _roll_back(services.store, condition, actor, reason))
    finally:
        services.registry.moved()
    about(f"{name}@{alias} -> {back.version}")
    response.headers["ETag"] = etag_of(back.seq)
    return _answer(back)


def etag_of(seq: int) -> str:
    """The entity tag of an alias whose newest record has this number."""
    return f'"{seq}"'


class _Condition:
    """What `If-Match` and `If-None-Match` demand of an alias. Raises InvalidInputError where they cannot be read."""

    def __init__(self, name: str, alias: str, if_match: str | None, if_none_match: str | None) -> None:
        self.name, self.alias = name, alias
        self.tags = None if if_match is None else tags_of(if_match)
        self.absent = if_none_match is not None
        if if_none_match is not None and if_none_match.strip() != ANY:
            raise InvalidInputError(fault("If-None-Match", if_none_match, ANY))

    def require(self, seq: int | None) -> None:
        """For an alias at record `seq`, None where there is none.

        Raises PreconditionRequiredError without any condition on an alias that exists, and PreconditionFailedError
        unless the conditions hold.
        """
        if seq is not None and self.tags is None and not self.absent:
            raise PreconditionRequiredError(
                f"alias {self.name}@{self.alias} exists: send If-Match with its ETag, which is {etag_of(seq)}"
            )
        is_at = "does not exist" if seq is None else f"is at {etag_of(seq)}"
        if self.absent and seq is not None:
            raise PreconditionFailedError(f"alias {self.name}@{self.alias} {is_at}, If-None-Match demands a new one")
        if self.tags is not None and (seq is None or not {ANY, etag_of(seq)} & self.tags):
            raise PreconditionFailedError(f"alias {self.name}@{self.alias} {is_at}, If-Match is {said_of(self.tags)}")


def said_of(tags: set[str]) -> str:
    """How the tags of an `If-Match` that does not hold stand in a message."""
    return ", ".join(sorted(tags))[:100] or "a weak tag, which never matches: send it without W/"


def tags_of(if_match: str) -> set[str]:
    """The strong entity tags that `If-Match` names, or `*` alone. Raises InvalidInputError."""
    if if_match.strip() == ANY:
        return {ANY}
    tags = set()
    for part in if_match.split(","):
        if (found := _TAG.fullmatch(part)) is None:
            raise InvalidInputError(fault("If-Match", if_match, 'an entity tag in quotes such as "3", or *'))
        if not found[1]:  # a weak tag never matches here (RFC 9110, 13.1.1)
            tags.add(f'"{found[2]}"')
    return tags


def _newest(store: ModelStore, condition: _Condition) -> int | None:
    try:
        return store.alias(condition.name, condition.alias).seq
    except AliasNotFoundError:
        return None


def _move(store: ModelStore, condition: _Condition, asked: AliasMove, actor: str) -> AliasRecord:
    try:
        seq = _newest(store, condition)
    except CorruptArtefactError:
        if condition.tags != {ANY}:
            raise
        expected = None  # wherever it points: that repairs an alias whose newest record is damaged
    else:
        condition.require(seq)
        expected = None if condition.tags == {ANY} else seq or 0
    try:
        return store.move_alias(
            condition.name, condition.alias, asked.version, actor=actor, reason=asked.reason, expected_seq=expected
        )
    except ConflictError as error:
        raise PreconditionFailedError(str(error)) from error


def _roll_back(store: ModelStore, condition: _Condition, actor: str, reason: str) -> AliasRecord:
    current = store.alias(condition.name, condition.alias)
    condition.require(current.seq)
    expected = None if condition.tags == {ANY} else current.seq
    try:
        return store.rollback(condition.name, condition.alias, actor=actor, reason=reason, expected_seq=expected)
    except ConflictError as error:
        if expected is None or current.previous_seq is None:
            raise  # nothing to go back to
        raise PreconditionFailedError(str(error)) from error


def _answer(record: AliasRecord) -> AliasAnswer:
    return AliasAnswer.model_validate(record, from_attributes=True)
