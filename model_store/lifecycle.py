"""What became of the versions of a model: archived, restored, deleted. One log for each model, which is only added to.

    models/<name>/lifecycle/<seq>.json      the record with the highest number holds, and says all of it

The log is also where moves of aliases and the retiring of versions meet, since no store locks anything. A mover adds
a *move* record before it writes that of the alias: "alias champion gets version 5 as its record 7". Whoever wants to
retire version 5 reads the log, settles every such move that is still open, looks where the aliases point, and adds its
own record under the next number. If anybody was faster, that number is taken and it begins again. So an alias never
comes to name a retired version, whoever is killed in between, and no clock is asked.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Literal

from pydantic import ValidationError

from model_store import layout
from model_store.backend import Backend
from model_store.documents import read_document, render
from model_store.errors import (
    ConflictError,
    CorruptArtefactError,
    InvalidDraftError,
    VersionArchivedError,
    VersionDeletedError,
)
from model_store.records import LifecycleRecord, OpenMove, Retired

State = Literal["published", "archived", "deleted"]

ATTEMPTS = 100
"""How often somebody who loses a race for the next record looks again."""


class Lifecycle:
    """The part of the store under `models/<name>/lifecycle`."""

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self._newest: dict[str, LifecycleRecord] = {}  # records never change, so the newest one read is kept

    def newest(self, name: str) -> LifecycleRecord | None:
        """The record that holds, None where nothing was ever retired and no alias moved since there is such a log.

        Costs one listing, and one small read when there is a new record.
        """
        seqs = (layout.record_seq(key) for key in self._backend.keys(layout.lifecycle_prefix(name)))
        seq = max((seq for seq in seqs if seq is not None), default=0)
        if not seq:
            return None
        known = self._newest.get(name)
        if known is None or known.seq != seq:
            known = self._newest[name] = self.record(name, seq)
        return known

    def record(self, name: str, seq: int) -> LifecycleRecord:
        """One record. Raises CorruptArtefactError and UnsupportedFormatError."""
        key = layout.lifecycle_record(name, seq)
        record = read_document(self._backend, key, LifecycleRecord)
        if record is None or record.seq != seq:
            raise CorruptArtefactError(f"{key} is gone or was moved here by hand; restore it from a backup")
        return record

    def retired(self, name: str) -> dict[int, Retired]:
        """The versions that are archived or deleted."""
        newest = self.newest(name)
        return {} if newest is None else {int(version): each for version, each in newest.retired.items()}

    def state(self, name: str, version: int) -> tuple[State, LifecycleRecord | None]:
        """Where the version stands, and the record that says so; None for one that was never archived."""
        newest = self.newest(name)
        state, seq = state_in(newest, version)
        return state, (self.record(name, seq) if seq else None)

    def require_usable(self, name: str, version: int) -> None:
        """Raises VersionArchivedError or VersionDeletedError."""
        _require_usable(self.newest(name), name, version)

    def looks(self, name: str) -> Iterator[LifecycleRecord | None]:
        """The newest record, looked up again for each attempt to add the next one.

        Raises ConflictError when a hundred others were faster.
        """
        for _ in range(ATTEMPTS):
            yield self.newest(name)
        raise ConflictError(f"versions and aliases of {name!r} changed {ATTEMPTS} times meanwhile; try again")

    def announce_move(self, name: str, move: OpenMove, *, actor: str) -> None:
        """Add that an alias is about to get this version as its record `seq`.

        Raises VersionArchivedError and VersionDeletedError, and then nothing was added; ConflictError as `looks`.
        """
        for newest in self.looks(name):
            _require_usable(newest, name, move.version)
            if move in _moves(newest):
                return  # by somebody else who wants the same: the record of the alias decides between them
            if self._append(name, newest, "move", move.version, actor, "", move):
                return

    def append(
        self, name: str, newest: LifecycleRecord | None, what: State, version: int, *, actor: str, reason: str
    ) -> LifecycleRecord | None:
        """Add what becomes of a version after `newest`; None when others were faster."""
        return self._append(name, newest, what, version, actor, reason)

    def open_moves(self, name: str, newest: LifecycleRecord | None, version: int) -> list[OpenMove]:
        """The moves to this version that were announced and whose record is not there (yet)."""
        return [each for each in _moves(newest) if each.version == version and not self._settled(name, each)]

    def _settled(self, name: str, move: OpenMove) -> bool:
        return self._backend.exists(layout.alias_record(name, move.alias, move.seq))

    def _append(
        self,
        name: str,
        newest: LifecycleRecord | None,
        what: State | Literal["move"],
        version: int,
        actor: str,
        reason: str,
        move: OpenMove | None = None,
    ) -> LifecycleRecord | None:
        moves = [each for each in _moves(newest) if not self._settled(name, each)]
        seq = 1 if newest is None else newest.seq + 1
        retired, restored = (dict(newest.retired), dict(newest.restored)) if newest else ({}, {})
        if what == "published":
            retired.pop(str(version), None)
            restored[str(version)] = seq
        elif what != "move":
            restored.pop(str(version), None)
            retired[str(version)] = Retired(state=what, seq=seq)
        record = _new_record(seq, what, version, actor, reason, retired, restored, [*moves, move] if move else moves)
        if not self._backend.create_or_confirm(layout.lifecycle_record(name, seq), render(record)):
            return None
        self._newest[name] = record
        return record


def state_in(newest: LifecycleRecord | None, version: int) -> tuple[State, int]:
    """Where the version stands after this record, and since which one; 0 for one that was never archived."""
    if newest is None:
        return "published", 0
    if (found := newest.retired.get(str(version))) is not None:
        return found.state, found.seq
    return "published", newest.restored.get(str(version), 0)


def _require_usable(newest: LifecycleRecord | None, name: str, version: int) -> None:
    found = None if newest is None else newest.retired.get(str(version))
    if found is None:
        return
    if found.state == "archived":
        raise VersionArchivedError(f"{name}@{version} is archived: restore it before it predicts or an alias names it")
    raise VersionDeletedError(f"{name}@{version} was deleted: its manifest and report are kept, its weights are gone")


def _moves(newest: LifecycleRecord | None) -> list[OpenMove]:
    return [] if newest is None else newest.moves


def _new_record(
    seq: int,
    what: str,
    version: int,
    actor: str,
    reason: str,
    retired: dict[str, Retired],
    restored: dict[str, int],
    moves: list[OpenMove],
) -> LifecycleRecord:
    try:
        return LifecycleRecord(
            seq=seq,
            what=what,
            version=version,
            time=datetime.now(UTC),
            actor=actor,
            reason=reason,
            retired=retired,
            restored=restored,
            moves=moves,
        )
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise InvalidDraftError(f"field '{first['loc'][0]}': {first['msg']}") from error
