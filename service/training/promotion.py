"""What becomes of a version that a job has published: the alias candidate, and champion when it is better.

A job moves each alias at most once, however often these run: its id stands in the reason of the move.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from model_store import DEFAULT_ALIAS, AliasNotFoundError, AliasRecord, ConflictError, ModelStore
from service.training.gate import Comparison, compare

CANDIDATE = "candidate"
CHAMPION = DEFAULT_ALIAS
_TRIES = 10


@dataclass(frozen=True, slots=True)
class JobVersion:
    """A version, the job that made it and who asked for that."""

    model: str
    version: int
    job: str
    actor: str


@dataclass(frozen=True, slots=True)
class Judged:
    """How the version compares with the champion it met, and the move that followed, if any."""

    comparison: Comparison
    move: AliasRecord | None


def move_candidate(store: ModelStore, made: JobVersion) -> AliasRecord:
    """Point candidate to the version. Raises ConflictError when others keep moving it, and what the store raises."""
    for _ in range(_TRIES):
        history = _history(store, made.model, CANDIDATE)
        if (done := _own_move(history, made)) is not None:
            return done
        try:
            return _move(store, made, CANDIDATE, history, "newest trained version")
        except ConflictError:
            continue
    raise ConflictError(
        f"{made.model}@{CANDIDATE} moved {_TRIES} times while training job {made.job} wanted to move it"
    )


def judge(
    store: ModelStore, made: JobVersion, *, margin: float, promote: bool, check: Callable[[], None] = lambda: None
) -> Judged:
    """Compare the version with the champion of now and, if that is wanted and it is better, point champion to it.

    When the champion moves in between, compares with the new one. `check` is called right before a move, and may raise
    to prevent it. Raises as `move_candidate`.
    """
    for _ in range(_TRIES):
        history = _history(store, made.model, CHAMPION)
        done = _own_move(history, made)
        before = _before(history, done) if done else (history[-1] if history else None)
        comparison = compare(store, made.model, made.version, None if before is None else before.version, margin=margin)
        if done is not None or not (promote and comparison.promote):
            return Judged(comparison, done)
        check()
        try:
            return Judged(comparison, _move(store, made, CHAMPION, history, comparison.sentence()))
        except ConflictError:
            continue
    raise ConflictError(f"{made.model}@{CHAMPION} moved {_TRIES} times while training job {made.job} was judged")


def describe_move(alias: str, record: AliasRecord) -> dict[str, Any]:
    """A move as plain JSON content."""
    return {"alias": alias, "version": record.version, "seq": record.seq, "reason": record.reason}


def _move(store: ModelStore, made: JobVersion, alias: str, history: list[AliasRecord], why: str) -> AliasRecord:
    seen = history[-1].seq if history else 0
    reason = f"{_mark(made)} {why}"[:4000]
    return store.move_alias(made.model, alias, made.version, actor=made.actor, reason=reason, expected_seq=seen)


def _history(store: ModelStore, model: str, alias: str) -> list[AliasRecord]:
    try:
        return store.alias_history(model, alias)
    except AliasNotFoundError:
        return []


def _own_move(history: list[AliasRecord], made: JobVersion) -> AliasRecord | None:
    return next((record for record in history if record.reason.startswith(_mark(made))), None)


def _before(history: list[AliasRecord], move: AliasRecord) -> AliasRecord | None:
    return next((record for record in reversed(history) if record.seq < move.seq), None)


def _mark(made: JobVersion) -> str:
    return f"training job {made.job}:"
