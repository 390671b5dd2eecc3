"""Versions taken out of use: archived and restored, or deleted for good. An alias never names one of these."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from typing import Annotated, Literal

from fastapi import Body, Query, Response
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from model_store import (
    ConflictError,
    LifecycleRecord,
    ModelStore,
    VersionInUseError,
    parse_reference,
)
from service.api.admin import ADMIN_PROBLEMS, Admin, AdminRoute, about
from service.api.http.exceptions import PreconditionFailedError
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import Services, TheServices
from service.api.v1.admin.aliases import ANY, IfMatch, etag_of, said_of, tags_of
from service.api.v1.models import MODEL_PROBLEMS, Name, Version, require_name

_ETAG = {"ETag": {"schema": {"type": "string"}, "description": "Number of the change in quotes, for `If-Match`."}}
_NOT_THERE = (Slug.MODEL_NOT_FOUND, Slug.VERSION_NOT_FOUND, Slug.INVALID_INPUT)
_WRITE_PROBLEMS = (*ADMIN_PROBLEMS, *_NOT_THERE, Slug.VERSION_DELETED, Slug.CONFLICT, Slug.PRECONDITION_FAILED)
_BODY_PROBLEMS = (Slug.MALFORMED_BODY, Slug.UNSUPPORTED_MEDIA_TYPE, Slug.BODY_TOO_LARGE)

Reason = Annotated[
    str,
    Field(max_length=4000, description="Reason, kept with the version.", examples=["slides where the rover climbed"]),
]
Change = Callable[..., LifecycleRecord | None]


class VersionChange(BaseModel):
    """Why a version is archived or restored."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    reason: Reason = ""


class DeletionQuery(BaseModel):
    """Why a version is deleted."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    reason: Reason = ""


class VersionStateAnswer(BaseModel):
    """Whether a version can be used. `since`, `actor` and `reason` are of the last change, null without any."""

    name: str
    version: int
    state: Literal["published", "archived", "deleted"]
    since: datetime | None = None
    actor: str | None = None
    reason: str | None = None


reading = Router(prefix="/v1/models", tags=["models"], responses=problem_responses(*MODEL_PROBLEMS), route_class=Route)
changing = Router(
    prefix="/v1/admin/models", tags=["models"], responses=problem_responses(*MODEL_PROBLEMS), route_class=AdminRoute
)


@reading.get(
    "/{name}/versions/{version}/state",
    summary="Whether a version can be used",
    responses=problem_responses(*_NOT_THERE) | {200: {"headers": _ETAG}},
)
async def get_version_state(
    name: Name, version: Version, services: TheServices, response: Response
) -> VersionStateAnswer:
    """Published, archived or deleted; since when, by whom and why. A change sends the `ETag` as `If-Match`."""
    require_name(name)
    return await _answer(services, name, version, response)


@changing.post(
    "/{name}/versions/{version}/archive",
    summary="Archive a version",
    responses=problem_responses(*_WRITE_PROBLEMS, *_BODY_PROBLEMS, Slug.VERSION_IN_USE) | {200: {"headers": _ETAG}},
)
async def archive_version(
    name: Name,
    version: Version,
    actor: Admin,
    services: TheServices,
    response: Response,
    asked: Annotated[VersionChange | SkipJsonSchema[None], Body()] = None,
    if_match: IfMatch = None,
) -> VersionStateAnswer:
    """Takes a version out of use: it predicts no more, and no alias can be pointed to it. Everything of it is kept.

    Refused while an alias names it. Archiving it again changes nothing. Replicas that have it in memory drop it within
    seconds.
    """
    reason = (asked or VersionChange()).reason
    change = _Change(services, name, version, if_match, actor, reason)
    await services.storage.run(lambda: change.make(services.store.archive_version, retires=True))
    return await _answer(services, name, version, response)


@changing.post(
    "/{name}/versions/{version}/restore",
    summary="Restore an archived version",
    responses=problem_responses(*_WRITE_PROBLEMS, *_BODY_PROBLEMS) | {200: {"headers": _ETAG}},
)
async def restore_version(
    name: Name,
    version: Version,
    actor: Admin,
    services: TheServices,
    response: Response,
    asked: Annotated[VersionChange | SkipJsonSchema[None], Body()] = None,
    if_match: IfMatch = None,
) -> VersionStateAnswer:
    """Brings an archived version back into use; one that is in use stays so. A deleted one cannot be restored."""
    reason = (asked or VersionChange()).reason
    change = _Change(services, name, version, if_match, actor, reason)
    await services.storage.run(lambda: change.make(services.store.restore_version))
    return await _answer(services, name, version, response)


@changing.delete(
    "/{name}/versions/{version}",
    summary="Delete a version",
    responses=problem_responses(*_WRITE_PROBLEMS, Slug.VERSION_IN_USE) | {200: {"headers": _ETAG}},
)
async def delete_version(
    name: Name,
    version: Version,
    actor: Admin,
    services: TheServices,
    response: Response,
    asked: Annotated[DeletionQuery, Query()],
    if_match: IfMatch = None,
) -> VersionStateAnswer:
    """Removes what the version predicts with, for good. Its number is never used again. Its manifest and report stay,
    so that the history of an alias, a job or another version still finds out what it was.

    Refused while an alias names it. Deleting it again finishes a deletion that was interrupted.
    """
    change = _Change(services, name, version, if_match, actor, asked.reason)
    await services.storage.run(lambda: change.make(services.store.delete_version, retires=True))
    return await _answer(services, name, version, response)


class _Change:
    """A change that was asked for, and what `If-Match` demands of the version before."""

    def __init__(
        self, services: Services, name: str, version: int, if_match: str | None, actor: str, reason: str
    ) -> None:
        require_name(name)
        about(f"{name}@{version}")
        self._services, self._name, self._version = services, name, version
        self._tags = None if if_match is None else tags_of(if_match)
        self._said = {"actor": actor, "reason": reason}

    def make(self, change: Change, *, retires: bool = False) -> None:
        """Raises VersionInUseError, PreconditionFailedError and what the store raises."""
        if retires:
            self._require_no_default()
        expected = None
        if self._tags is not None and self._tags != {ANY}:
            expected = _seq(self._services.store, self._name, self._version)
            if etag_of(expected) not in self._tags:
                place, said = f"{self._name}@{self._version}", said_of(self._tags)
                raise PreconditionFailedError(f"{place} is at {etag_of(expected)}, If-Match is {said}")
        try:
            change(self._name, self._version, expected_seq=expected, **self._said)
        except VersionInUseError:
            raise
        except ConflictError as error:
            if expected is None:
                raise
            raise PreconditionFailedError(str(error)) from error
        finally:
            self._services.registry.moved()

    def _require_no_default(self) -> None:
        """The model that answers by default may be named by its number, in the settings."""
        default = parse_reference(self._services.settings.default_model)
        if (default.name, default.version) == (self._name, self._version):
            raise VersionInUseError(self._name, self._version, [])


def _seq(store: ModelStore, name: str, version: int) -> int:
    record = store.version_state(name, version)[1]
    return 0 if record is None else record.seq


async def _answer(services: Services, name: str, version: int, response: Response) -> VersionStateAnswer:
    state, record = await services.storage.run(lambda: services.store.version_state(name, version))
    response.headers["ETag"] = etag_of(0 if record is None else record.seq)
    if record is None:
        return VersionStateAnswer(name=name, version=version, state=state)
    return VersionStateAnswer(
        name=name, version=version, state=state, since=record.time, actor=record.actor, reason=record.reason
    )
