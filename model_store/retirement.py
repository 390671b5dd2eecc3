"""Archiving, restoring and deleting versions, each safe against moves of aliases at the same moment (`lifecycle`)."""

from __future__ import annotations

from typing import Literal

from model_store import layout
from model_store.aliases import Aliases
from model_store.backend import Backend
from model_store.errors import ConflictError, VersionDeletedError, VersionInUseError
from model_store.lifecycle import Lifecycle, state_in
from model_store.records import LifecycleRecord, Retired
from model_store.versions import Versions


class Retirement:
    """What `ModelStore` documents as archive_version, restore_version and delete_version."""

    def __init__(self, backend: Backend, versions: Versions, aliases: Aliases, lifecycle: Lifecycle) -> None:
        self._backend = backend
        self._versions = versions
        self._aliases = aliases
        self._lifecycle = lifecycle

    def archive(self, name: str, version: int, *, actor: str, reason: str, expected_seq: int | None) -> LifecycleRecord:
        """The record that says so, an earlier one where it is archived already."""
        return self._retire(name, version, "archived", actor, reason, expected_seq)

    def restore(
        self, name: str, version: int, *, actor: str, reason: str, expected_seq: int | None
    ) -> LifecycleRecord | None:
        """The record that says so; None where it was not archived."""
        self._versions.require(name, version)
        for newest in self._lifecycle.looks(name):
            found = _of(newest, version)
            _check_expected(name, version, newest, expected_seq)
            if found is None:
                return None
            if found.state == "deleted":
                raise VersionDeletedError(f"{name}@{version} was deleted: its weights are gone, so it stays deleted")
            if record := self._lifecycle.append(name, newest, "published", version, actor=actor, reason=reason):
                return record
        return None  # not reached: `looks` raises

    def delete(self, name: str, version: int, *, actor: str, reason: str, expected_seq: int | None) -> LifecycleRecord:
        """First the record, so that nobody predicts with it any more, then the files; again finishes what was begun."""
        record = self._retire(name, version, "deleted", actor, reason, expected_seq)
        for file in self._versions.manifest(name, version).files:
            if layout.goes_with_deletion(file):
                self._backend.remove(f"{layout.version_prefix(name, version)}/{file}")
        return record

    def _retire(
        self,
        name: str,
        version: int,
        state: Literal["archived", "deleted"],
        actor: str,
        reason: str,
        expected_seq: int | None,
    ) -> LifecycleRecord:
        self._versions.require(name, version)
        for newest in self._lifecycle.looks(name):
            found = _of(newest, version)
            _check_expected(name, version, newest, expected_seq)
            if found is not None and found.state == state:
                return self._lifecycle.record(name, found.seq)
            if found is not None and found.state == "deleted":
                raise VersionDeletedError(f"{name}@{version} was deleted: there is nothing left to archive")
            for move in self._lifecycle.open_moves(name, newest, version):
                self._aliases.settle(name, move, actor=actor)
            if named := self._aliases.naming(name, version):
                raise VersionInUseError(name, version, named)
            if record := self._lifecycle.append(name, newest, state, version, actor=actor, reason=reason):
                return record
        raise AssertionError  # not reached: `looks` raises


def _of(newest: LifecycleRecord | None, version: int) -> Retired | None:
    return None if newest is None else newest.retired.get(str(version))


def _check_expected(name: str, version: int, newest: LifecycleRecord | None, expected: int | None) -> None:
    state, seq = state_in(newest, version)
    if expected is not None and expected != seq:
        raise ConflictError(f"{name}@{version} is {state} since record {seq}, expected was {expected}: look again")
