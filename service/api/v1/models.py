"""`/v1/models`: what is published. Read from the store itself, so that it shows what was published a moment ago."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Request, Response
from pydantic import BaseModel

from model_store import (
    AliasNotFoundError,
    CorruptArtefactError,
    Manifest,
    ModelNotFoundError,
    ModelStore,
    UnsupportedFormatError,
    layout,
)
from model_store.references import DEFAULT_ALIAS
from service.api.http.answers.delivery import CACHE_HEADERS, NOT_MODIFIED, Delivery
from service.api.http.openapi import problem_responses
from service.api.http.problems import Slug
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import TheServices
from service.wire.forms.numbers import dump
from service.wire.whole_numbers import PLAIN_INTEGER


class ModelEntry(BaseModel):
    """A model with its versions, rising, and the version that each alias points to. `versions` can be used; `archived`
    ones could be restored, `deleted` ones have a manifest and a report left.

    `unreadable` says why the aliases of a model with a damaged record are not shown; null when all is well.
    """

    name: str
    versions: list[int]
    archived: list[int] = []
    deleted: list[int] = []
    aliases: dict[str, int]
    unreadable: str | None = None


class ModelAnswer(ModelEntry):
    """A model with the description of its champion, or of its newest version if there is no champion."""

    description: str


class ModelsAnswer(BaseModel):
    """All models."""

    models: list[ModelEntry]


MODEL_PROBLEMS = (Slug.ARTEFACT_CORRUPT, Slug.UNSUPPORTED_FORMAT, Slug.STORE_UNAVAILABLE, Slug.OVERLOADED)

router = Router(
    prefix="/v1/models",
    tags=["models"],
    responses=problem_responses(*MODEL_PROBLEMS),
    route_class=Route,
)

_NO_MODEL = problem_responses(Slug.MODEL_NOT_FOUND)


Name = Annotated[str, Path(description="Name of a model.", examples=["viper-lunar"])]
Alias = Annotated[str, Path(description="Name of an alias.", examples=[DEFAULT_ALIAS])]
Version = Annotated[
    int,
    Path(ge=1, le=layout.MAX_VERSION, description="Number of a version.", examples=[1]),
    PLAIN_INTEGER,
]


@router.get("", summary="All models")
async def list_models(services: TheServices) -> ModelsAnswer:
    """Every model with its versions and aliases.

    Of a remote store this is what the last look at it found, at most 12 s ago unless the operator chose another
    interval; what was changed through this process shows at once.
    """
    state = services.registry.fingerprint()
    if state is None:
        return await services.storage.run(lambda: _all_models(services.store))
    kept: ModelsAnswer = await services.models.get(
        state, lambda: services.storage.run(lambda: _all_models(services.store))
    )
    return kept


@router.get("/{name}", summary="One model", responses=_NO_MODEL)
async def get_model(name: Name, services: TheServices) -> ModelAnswer:
    """A model with its versions, aliases and description."""
    require_name(name)
    return await services.storage.run(lambda: _described(services.store, name))


@router.get(
    "/{name}/versions/{version}",
    summary="The manifest of a version",
    response_class=Response,
    response_model=None,
    responses=problem_responses(Slug.MODEL_NOT_FOUND, Slug.VERSION_NOT_FOUND, Slug.INVALID_INPUT)
    | NOT_MODIFIED
    | {200: {"model": Manifest, "description": "The manifest as it was published.", "headers": CACHE_HEADERS}},
)
async def get_version(name: Name, version: Version, request: Request, services: TheServices) -> Response:
    """What the version is, where it holds, how good it is and what it was made from."""
    require_name(name)
    return await services.storage.run(lambda: _manifest(services.store, name, version, request))


def require_name(name: str, alias: str | None = None) -> None:
    """Raises ModelNotFoundError or AliasNotFoundError: in an address a malformed name is one that does not exist."""
    if not layout.is_name(name):
        raise ModelNotFoundError(f"no model '{name[:100]}': names have a-z, 0-9 and '-', at most 63 characters")
    if alias is not None and not layout.is_alias(alias):
        raise AliasNotFoundError(
            f"model '{name}' has no alias '{alias[:100]}': aliases have a-z, 0-9 and '-' and start with a letter"
        )


def _manifest(store: ModelStore, name: str, version: int, request: Request) -> Response:
    """Read even for a 304: a version that is gone or damaged must not seem to be well."""
    body = dump(store.manifest(name, version).model_dump(mode="json"))
    delivery = Delivery.of(request, "application/json", text=True, negotiated=False).tagged(request, body, fixed=True)
    return delivery.not_modified() or delivery.response(body)


def _all_models(store: ModelStore) -> ModelsAnswer:
    return ModelsAnswer(models=[_listed(store, name) for name in store.model_names()])


def _listed(store: ModelStore, name: str) -> ModelEntry:
    """One damaged alias must not hide every model."""
    try:
        return _entry(store, name)
    except (CorruptArtefactError, UnsupportedFormatError) as error:
        return ModelEntry(name=name, versions=store.versions(name, retired=True), aliases={}, unreadable=str(error))


def _entry(store: ModelStore, name: str) -> ModelEntry:
    aliases = {alias: record.version for alias, record in store.aliases(name).items()}
    retired = store.retired(name)
    archived = sorted(version for version, each in retired.items() if each.state == "archived")
    deleted = sorted(retired.keys() - set(archived))
    versions = [version for version in store.versions(name, retired=True) if version not in retired]
    return ModelEntry(name=name, versions=versions, archived=archived, deleted=deleted, aliases=aliases)


def _described(store: ModelStore, name: str) -> ModelAnswer:
    entry = _entry(store, name)
    newest = max(entry.versions or entry.archived or entry.deleted)
    shown = entry.aliases.get(DEFAULT_ALIAS, newest)
    description = store.manifest(name, shown).description
    return ModelAnswer(**entry.model_dump(), description=description)
