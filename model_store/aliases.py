"""Aliases: names that move between versions, with every move on record."""

from __future__ import annotations

from collections import defaultdict
from datetime import UTC, datetime

from pydantic import ValidationError

from model_store import layout
from model_store.backend import Backend
from model_store.documents import read_document, render
from model_store.errors import (
    AliasNotFoundError,
    ConflictError,
    CorruptArtefactError,
    InvalidDraftError,
    VersionNotFoundError,
)
from model_store.lifecycle import Lifecycle
from model_store.records import AliasRecord, OpenMove
from model_store.references import Resolved, parse_reference
from model_store.versions import Versions

MOVE_ATTEMPTS = 100
"""How often a move without `expected_seq` looks again after losing a race."""


class Aliases:
    """The part of the store under `models/<name>/aliases`. `ModelStore` documents each method."""

    def __init__(self, backend: Backend, versions: Versions, lifecycle: Lifecycle) -> None:
        self._backend = backend
        self._versions = versions
        self._lifecycle = lifecycle

    def all(self, name: str) -> dict[str, AliasRecord]:
        """The record that holds, for every alias of the model."""
        newest = self._newest(name)
        return {alias: self._record(name, alias, seq) for alias, seq in sorted(newest.items())}

    def current(self, name: str, alias: str) -> AliasRecord:
        """The record that holds."""
        return self._record(name, alias, self._recorded(name, alias)[-1])

    def history(self, name: str, alias: str) -> list[AliasRecord]:
        """Every record, oldest first."""
        return [self._record(name, alias, seq) for seq in self._recorded(name, alias)]

    def resolve(self, reference: str) -> Resolved:
        """The version a reference means now."""
        parsed = parse_reference(reference)
        if parsed.version is not None:
            self._versions.require(parsed.name, parsed.version)
            return Resolved(parsed.name, parsed.version, None)
        alias = str(parsed.alias)
        version = self.current(parsed.name, alias).version
        if not self._versions.exists(parsed.name, version):
            raise VersionNotFoundError(
                f"alias {parsed.name}@{alias} points to version {version}, which is not in the store; "
                f"move the alias to a published version or restore {layout.version_prefix(parsed.name, version)}"
            )
        return Resolved(parsed.name, version, alias)

    def move(
        self, name: str, alias: str, version: int, *, actor: str, reason: str, expected_seq: int | None
    ) -> AliasRecord:
        """Add a record pointing to a published version."""
        self._versions.require(name, version)
        for _ in range(MOVE_ATTEMPTS):
            seqs = self._seqs(name, alias)
            newest = seqs[-1] if seqs else 0
            _check_expected(name, alias, newest, expected_seq)
            moved = _new_record(newest + 1, version, actor, reason, self._way_back(name, alias, seqs, version))
            self._lifecycle.announce_move(name, OpenMove(alias=alias, seq=moved.seq, version=version), actor=actor)
            if self._append(name, alias, moved):
                return moved
            if expected_seq is not None:
                raise _overtaken(name, alias)
        raise ConflictError(f"alias {name}@{alias} moved {MOVE_ATTEMPTS} times meanwhile; look at it and try again")

    def rollback(self, name: str, alias: str, *, actor: str, reason: str, expected_seq: int | None) -> AliasRecord:
        """Add a record that takes the last version change back."""
        current = self.current(name, alias)
        _check_expected(name, alias, current.seq, expected_seq)
        if current.previous_seq is None:
            raise ConflictError(
                f"alias {name}@{alias} has nothing to roll back to: version {current.version} is the first it had; "
                "move it to a version by number"
            )
        restored = self._record(name, alias, current.previous_seq)
        self._versions.require(name, restored.version)
        back = _new_record(current.seq + 1, restored.version, actor, reason, restored.previous_seq)
        announced = OpenMove(alias=alias, seq=back.seq, version=back.version)
        self._lifecycle.announce_move(name, announced, actor=actor)
        if not self._append(name, alias, back):
            # never retried: a second look would take back the other one's change, not the one meant here
            raise _overtaken(name, alias)
        return back

    def naming(self, name: str, version: int) -> list[str]:
        """The aliases that point to the version now."""
        return [alias for alias, record in self.all(name).items() if record.version == version]

    def settle(self, name: str, move: OpenMove, *, actor: str) -> None:
        """See to it that there is the record that was announced, so that whoever announced it comes too late.

        The alias stays where it is. One that does not exist yet has nowhere to stay: there the move is carried out.
        """
        seqs = [seq for seq in self._seqs(name, move.alias) if seq < move.seq]
        if not seqs:
            made = _new_record(move.seq, move.version, actor, "finished for one who was interrupted", None)
        else:
            now = self._record(name, move.alias, seqs[-1])
            why = f"stays, for version {move.version} is about to be retired"
            made = _new_record(move.seq, now.version, actor, why, now.previous_seq)
        self._append(name, move.alias, made)

    def _way_back(self, name: str, alias: str, seqs: list[int], version: int) -> int | None:
        # an unreadable record must not keep anybody from moving the alias away from it: look below it
        for seq in reversed(seqs):
            try:
                below = self._record(name, alias, seq)
            except CorruptArtefactError:
                continue
            return below.previous_seq if below.version == version else seq
        return None

    def _append(self, name: str, alias: str, record: AliasRecord) -> bool:
        return self._backend.create_or_confirm(layout.alias_record(name, alias, record.seq), render(record))

    def _record(self, name: str, alias: str, seq: int) -> AliasRecord:
        key = layout.alias_record(name, alias, seq)
        record = read_document(self._backend, key, AliasRecord)
        if record is None:
            raise CorruptArtefactError(f"{key} is gone; move the alias {name}@{alias} to a published version")
        if record.seq != seq:
            raise CorruptArtefactError(
                f"{key} says it is record {record.seq}: it was moved here by hand; "
                f"move the alias {name}@{alias} to a published version"
            )
        return record

    def _recorded(self, name: str, alias: str) -> list[int]:
        seqs = self._seqs(name, alias)
        if not seqs:
            known = ", ".join(sorted(self._newest(name))) or "none yet"
            raise AliasNotFoundError(f"model {name!r} has no alias {alias!r}; its aliases: {known}")
        return seqs

    def _newest(self, name: str) -> dict[str, int]:
        newest: dict[str, int] = defaultdict(int)
        for key in self._backend.keys(layout.aliases_prefix(name)):
            alias, _, file = key.partition("/")
            if layout.is_alias(alias) and (seq := layout.record_seq(file)) is not None:
                newest[alias] = max(newest[alias], seq)
        if not newest:
            self._versions.numbers(name)  # a model without aliases is fine, one without versions is not there
        return newest

    def _seqs(self, name: str, alias: str) -> list[int]:
        found = (layout.record_seq(key) for key in self._backend.keys(layout.alias_prefix(name, alias)))
        return sorted(seq for seq in found if seq is not None)


def _check_expected(name: str, alias: str, newest: int, expected: int | None) -> None:
    if expected is not None and expected != newest:
        raise ConflictError(
            f"alias {name}@{alias} is at record {newest}, expected was {expected}: it moved meanwhile; "
            "read it again, then decide again"
        )


def _overtaken(name: str, alias: str) -> ConflictError:
    return ConflictError(f"alias {name}@{alias} was moved by somebody else just now; read it again, then decide again")


def _new_record(seq: int, version: int, actor: str, reason: str, previous_seq: int | None) -> AliasRecord:
    try:
        return AliasRecord(
            seq=seq, version=version, time=datetime.now(UTC), actor=actor, reason=reason, previous_seq=previous_seq
        )
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        raise InvalidDraftError(f"alias move: field '{first['loc'][0]}': {first['msg']}") from error
