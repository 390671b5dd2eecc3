"""Somebody retires a version while others point aliases to it, in any order of what they do to the store, and killed
at any moment: an alias never comes to name a version that is retired.

Each actor runs on a thread of its own and stops before everything that it does to the store, until it is its turn. The
store is in memory, where a create is as conditional as on S3.
"""

from __future__ import annotations

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from model_store import ConflictError, Lineage, ManifestDraft, ModelStore, VersionRetiredError
from model_store.backend import Backend

BY = {"actor": "tests", "reason": "because"}
LONGEST_WAIT_S = 20.0


class KilledError(BaseException):
    """The process is no more."""


class Turns(Backend):
    """A backend whose every call waits for its turn; `budget` calls in, its user is killed."""

    def take_part(self, budget):
        self.budget = budget
        self.may = threading.Semaphore(0)
        self.did = threading.Semaphore(0)
        return self

    def wait(self):
        self.did.release()
        assert self.may.acquire(timeout=LONGEST_WAIT_S)
        if self.budget is not None:
            self.budget -= 1
            if self.budget < 0:
                raise KilledError

    def read(self, key, *, limit_bytes):
        self.wait()
        return super().read(key, limit_bytes=limit_bytes)

    def exists(self, key):
        self.wait()
        return super().exists(key)

    def create(self, key, data):
        self.wait()
        return super().create(key, data)

    def remove(self, key):
        self.wait()
        return super().remove(key)

    def keys(self, prefix):
        self.wait()
        return super().keys(prefix)


class Actor:
    """Does one thing to the store, one call at a time."""

    def __init__(self, backend, action, budget):
        self.turns = Turns(backend._objects, backend.location).take_part(budget)
        self.error = None
        self.active = True
        self.thread = threading.Thread(target=self._run, args=(action, ModelStore(self.turns)), daemon=True)
        self.thread.start()
        assert self.turns.did.acquire(timeout=LONGEST_WAIT_S)

    def _run(self, action, store):
        try:
            action(store)
        except (ConflictError, VersionRetiredError, KilledError) as error:
            self.error = error
        finally:
            self.active = False
            self.turns.did.release()

    def step(self):
        self.turns.may.release()
        assert self.turns.did.acquire(timeout=LONGEST_WAIT_S)


def played(actions, schedule, budgets):
    """Let the actors act in this order, then one after the other to the end; the store and the actors."""
    backend = Backend.open("memory://")
    store = ModelStore(backend)
    draft = ManifestDraft(created_by="x", checkpoint={}, domain={}, metrics={}, lineage=Lineage())
    for _ in range(3):
        store.publish("viper", {"weights.safetensors": b"w"}, draft)
    for version in (2, 3):
        store.move_alias("viper", "champion", version, **BY)
    actors = [Actor(backend, action, budget) for action, budget in zip(actions, budgets, strict=True)]
    for turn in schedule:
        actor = actors[turn % len(actors)]
        if actor.active:
            actor.step()
    for actor in actors:
        for _ in range(1000):
            if not actor.active:
                break
            actor.step()
        assert not actor.active
        actor.thread.join(LONGEST_WAIT_S)
    return store, actors


def check_laws(store):
    for alias, record in store.aliases("viper").items():
        store.require_usable("viper", record.version)
        assert store.verify("viper", store.resolve(f"viper@{alias}").version)
    assert store.versions("viper", retired=True) == [1, 2, 3]


def promote(alias):
    return lambda store: store.move_alias("viper", alias, 2, **BY)


ROLL_BACK = lambda store: store.rollback("viper", "champion", **BY)  # noqa: E731
ARCHIVE = lambda store: store.archive_version("viper", 2, **BY)  # noqa: E731
DELETE = lambda store: store.delete_version("viper", 2, **BY)  # noqa: E731

MOVES = [promote("champion"), promote("candidate"), ROLL_BACK]
SCHEDULES = st.lists(st.integers(0, 2), max_size=40)
BUDGETS = st.none() | st.integers(0, 15)


@pytest.mark.slow
@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(
    retire=st.sampled_from([ARCHIVE, DELETE]),
    moves=st.tuples(st.sampled_from(MOVES), st.sampled_from(MOVES)),
    schedule=SCHEDULES,
    budgets=st.tuples(BUDGETS, BUDGETS, BUDGETS),
)
def test_no_alias_comes_to_name_a_retired_version(retire, moves, schedule, budgets):
    store, _ = played([retire, *moves], schedule, budgets)
    check_laws(store)
    # and nothing that was killed stands in the way of what comes after it
    store.move_alias("viper", "champion", 3, **BY)
    store.move_alias("viper", "candidate", 3, **BY)
    store.delete_version("viper", 2, **BY)
    check_laws(store)


@pytest.mark.slow
@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("steps", range(14))
def test_of_a_mover_and_one_who_retires_exactly_one_has_its_way(move, steps):
    """The mover does so many calls, then the other one all of his, then the mover goes on."""
    store, (retires, moves) = played([ARCHIVE, move], [1] * steps + [0] * 60, [None, None])
    check_laws(store)
    assert (retires.error is None) != (moves.error is None)
    assert (store.version_state("viper", 2)[0] == "archived") == (retires.error is None)


@pytest.mark.slow
@pytest.mark.parametrize("killed_after", range(14))
def test_a_mover_that_was_killed_blocks_nobody(killed_after):
    """A live alias stays where it is, and the version can be archived; or the move was through."""
    store, _ = played([promote("champion")], [], [killed_after])
    if store.alias("viper", "champion").version == 3:
        store.archive_version("viper", 2, **BY)
        assert store.alias("viper", "champion").version == 3
    check_laws(store)
