"""Triton's model repository: what is published, what of it is in memory, and bringing it there or dropping it.

Nothing that is published needs to be loaded first: a request loads what it names. `load` only does so ahead of time,
`unload` only makes room. Both want a token all the same: who unloads without end makes all others wait for loading.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from model_store import ModelNotFoundError, ModelStore, StoreError, VersionNotFoundError, layout, parse_reference
from service.api.v2.failures import UnsupportedError
from service.api.v2.wire import Parameters
from service.twin import RegistryStatus, TwinRegistry
from service.wire.faults import InvalidInputError, fault

_NOT_LOADABLE = "it cannot be loaded; with a token this says why"
_NOT_LOADED = "not in memory; a load or the first request brings it there"


class IndexRequest(BaseModel):
    """The body of an index request, which may be empty."""

    model_config = ConfigDict(strict=True)

    ready: bool = Field(default=False, description="Only what is in memory.")


class RepositoryRequest(BaseModel):
    """The body of a load or unload request, which may be empty."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    parameters: Parameters = Field(default_factory=dict)


class IndexEntry(BaseModel):
    """One version; READY means that it is in memory."""

    name: str
    version: str
    state: Literal["READY", "UNAVAILABLE"]
    reason: str


def reference_of(name: str, version: str | None = None) -> str:
    """What an address names: a model, by number or alias a version of it.

    In an address a malformed name is simply one that does not exist: raises ModelNotFoundError, VersionNotFoundError.
    """
    if not layout.is_name(name):
        raise ModelNotFoundError(f"no model '{name[:100]}': names have a-z, 0-9 and '-', at most 63 characters")
    if version is None:
        return name
    if layout.version_number(version) is None and not layout.is_alias(version):
        raise VersionNotFoundError(
            f"model '{name}' has no version '{version[:100]}': a version is a number such as 3, or an alias"
        )
    return f"{name}@{version}"


def index_of(store: ModelStore, status: RegistryStatus, ready_only: bool, *, with_reasons: bool) -> list[IndexEntry]:
    """Every published version. Raises what the store raises."""
    failed = {place: reason if with_reasons else _NOT_LOADABLE for place, reason in _failed(store, status)}
    return [
        each for each in _entries(store, frozenset(status.resident), failed) if each.state == "READY" or not ready_only
    ]


def _entries(store: ModelStore, resident: frozenset[str], failed: dict[str, str]) -> Iterator[IndexEntry]:
    for name in store.model_names():
        for version in store.versions(name):
            place = f"{name}@{version}"
            if place in resident:
                yield IndexEntry(name=name, version=str(version), state="READY", reason="")
            else:
                reason = failed.get(place, _NOT_LOADED)
                yield IndexEntry(name=name, version=str(version), state="UNAVAILABLE", reason=reason)


def _failed(store: ModelStore, status: RegistryStatus) -> Iterator[tuple[str, str]]:
    """Which versions could not be loaded, with the reason; the registry knows them by what was asked for."""
    for reference, reason in status.failures:
        try:
            resolved = store.resolve(reference)
        except StoreError:  # then no version is to blame
            continue
        yield f"{resolved.name}@{resolved.version}", reason


def require_loadable(parameters: Parameters) -> None:
    """Raises UnsupportedError for a configuration or files in the request: versions are published, not sent along."""
    for name in parameters:
        if name == "config" or name.startswith("file:"):
            raise UnsupportedError(f"parameter {name[:100]}: published versions are immutable, nothing overrides them")


def unload(registry: TwinRegistry, store: ModelStore, name: str, default_reference: str) -> None:
    """Drop all versions of a model from memory. Raises InvalidInputError for the model that must stay.

    What runs on them finishes. Raises what the store raises for a model that is not published.
    """
    if name == parse_reference(default_reference).name:
        raise InvalidInputError(fault("model", name, "a model other than the service's default, which stays loaded"))
    store.versions(name)
    registry.unload(name)
