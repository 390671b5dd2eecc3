"""The other fault table: states in which nobody died, but something does not do its part.

    python -m tests.faults.state_table --rounds 10 --seed 1

States: the jobs database was deleted, the store hangs, PostgreSQL is frozen, a disk is full. A round enters one, and
meanwhile clients start a job, upload a dataset, move an alias, and archive or delete a version, and API or worker is
killed at a random moment. Then the state ends: somebody thaws it, makes room, or restarts the service. What was
refused is asked for again, and then what was acknowledged has to be there, once and whole, and on record.
"""

from __future__ import annotations

import argparse
import collections
import functools
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from model_store import AliasRecord, StoreError
from service.jobs.queue import JobQueue
from tests.api.chrono_uploads import archive
from tests.databases import start_postgres
from tests.faults.crash_checks import COLUMNS, check_audit, check_dataset, check_job, check_leftovers, check_move
from tests.faults.crash_world import Steps, World
from tests.jobs.nursery import Nursery, until
from tests.s3 import S3Server
from tests.small_disk import fill, small_disk
from tests.twin.published import publish

_JOB = {
    "model": "rover",
    "datasets": ["unit"],
    "split": {"test_slopes_deg": [12]},
    "promote": "if_better",
    "architecture": "zero",
    "prior": "rigid_slope",
}
_SPARE = "spare"  # a model with versions that nobody trained: two for an alias, one for each round to retire
_MOVED = f"{_SPARE}@by-hand"
_VICTIMS = ("api", "worker", "nobody")
_CLIENTS = 4
_ON_THE_WAY = 0.5  # share of rounds in which the state begins while the clients do; what a deletion finds is lost
_BEGIN_S = 0.7  # within which the clients begin
_KILL_S = 1.5  # within which somebody is killed
_STAY_S = 5.0  # for which the state goes on at most
RETIRED = "wrong state"
WRONG = (*COLUMNS, RETIRED)


@dataclass
class Row:
    """One line of the table: rounds, what clients were told in the state, and what was wrong after it."""

    rounds: int = 0
    told: collections.Counter[str] = field(default_factory=collections.Counter)
    wrong: collections.Counter[str] = field(default_factory=collections.Counter)

    def line(self, *names: str) -> str:
        told = [self.told[each] for each in ("acknowledged", "refused", "no answer")]
        return f"| {' | '.join(map(str, [*names, self.rounds, *told, *(self.wrong[each] for each in WRONG)]))} |"


@dataclass
class Table:
    """State and who was killed in it, and what came of it."""

    rows: dict[tuple[str, str], Row] = field(default_factory=lambda: collections.defaultdict(Row))
    faults: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def markdown(self) -> str:
        """The table as it goes into documents."""
        head = ("state", "killed in it", "rounds", "acknowledged", "refused", "no answer", *WRONG)
        lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
        total = Row()
        for (state, victim), row in sorted(self.rows.items()):
            total.rounds += row.rounds
            total.told += row.told
            total.wrong += row.wrong
            lines.append(row.line(state, victim))
        lines.append(total.line("**all**", ""))
        return "\n".join([*lines, "", *(f"- {fault}" for fault in self.faults)]).rstrip() + "\n"


# ---- states: each is entered with the world, and ended as an operator would end it


@contextmanager
def _deleted(world: World, how: str) -> Iterator[None]:
    file = world.jobs_file
    world.queue.close()  # nor must this process hold it
    if how == "with its folder":
        shutil.rmtree(file.parent)
    elif how == "its log only":
        file.with_name(f"{file.name}-wal").unlink()
    elif how == "replaced":
        file.with_name("other").write_bytes(b"")
        file.with_name("other").replace(file)
    else:
        file.unlink()
    try:
        yield
    finally:
        world.restart()
        world.queue = JobQueue.open(world.url, 1000)


@contextmanager
def _frozen(world: World, _how: str) -> Iterator[None]:
    assert world.postgres is not None
    world.postgres.freeze()
    try:
        yield
    finally:
        world.postgres.thaw()


@contextmanager
def _full(folder: Path, _world: World, how: str) -> Iterator[None]:
    filler = fill(folder / how)
    try:
        yield
    finally:
        filler.unlink()


DELETED = "jobs database deleted"
Enter = Callable[[World, str], AbstractContextManager[None]]
STATES: dict[str, tuple[str, ...]] = {
    DELETED: ("the file", "with its folder", "replaced"),
    "store hangs": ("hang", "trickle", "frozen"),
    "PostgreSQL frozen": ("",),
    "disk full": ("store", "jobs", "temporary"),
}
"""And the ways to be in each."""


@contextmanager
def _world_of(state: str) -> Iterator[tuple[World, Enter]]:
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="states-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        postgres, url, enter = None, None, _deleted
        if state == "PostgreSQL frozen":
            postgres, enter = stack.enter_context(contextmanager(start_postgres)()), _frozen
        elif state == "store hangs":
            s3 = stack.enter_context(S3Server.started(folder / "s3"))
            stack.enter_context(_environment(s3.environment))
            url, enter = s3.url(), lambda _world, how: s3.misbehaving(how)
        elif state == "disk full":
            for place in STATES[state]:
                stack.enter_context(small_disk(folder / place, "16m"))
            enter = functools.partial(_full, folder)
        steps = Steps()
        nursery = stack.enter_context(Nursery(apis=True, heard=steps.heard))
        yield stack.enter_context(World(folder, nursery, steps, postgres, url)), enter


@contextmanager
def _environment(more: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in more}
    os.environ.update(more)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@dataclass(frozen=True)
class _Asked:
    """What the clients of a round ask for."""

    key: str
    data: bytes
    before: list[AliasRecord]
    retired: int
    end: str

    @property
    def to(self) -> int:
        return 3 - self.before[-1].version

    def calls(self, world: World) -> dict[str, Callable[[], Any]]:
        """Each call once; asked again it is the same one."""
        return {
            "job": lambda: world.submit(_JOB, self.key),
            "upload": lambda: world.upload(self.data),
            "move": lambda: world.move(_MOVED, self.to, len(self.before)),
            "retire": lambda: world.retire(_SPARE, self.retired, self.end),
        }


class Rounds:
    """Rounds of one state, in a world of their own."""

    def __init__(self, world: World, enter: Enter, state: str, dice: random.Random, table: Table) -> None:
        self._world, self._enter, self._state, self._dice, self._table = world, enter, state, dice, table
        self._number = 0
        for _ in range(2):
            publish(world.store, _SPARE)
        assert world.move(_MOVED, 1, 0) == 1
        assert world.upload(archive()) is not None
        job_id = world.submit(_JOB, _key(state, 0))
        assert job_id is not None
        job = world.ended(job_id)
        assert job is not None
        assert job.result is not None, job.failure
        manifest = world.store.manifest(job.result.model, job.result.version)
        self._weights = manifest.files["weights.safetensors"].sha256
        assert check_audit(world) == {}

    def round(self, how: str, victim: str) -> None:
        """The state, four clients and a kill in it, and the look at what it left."""
        world, dice = self._world, self._dice
        self._number += 1
        asked = _Asked(
            key=_key(self._state, self._number),
            data=archive(seed=1e-4 * self._number),
            before=world.moves_of(_MOVED),
            retired=publish(world.store, _SPARE).version,
            end=dice.choice(("archived", "deleted")),
        )
        refused = world.refused
        with ThreadPoolExecutor(_CLIENTS) as pool, ExitStack() as ending:
            on_the_way = self._state != DELETED and dice.random() < _ON_THE_WAY
            if not on_the_way:
                ending.enter_context(self._enter(world, how))
            waiting = {name: pool.submit(self._later, call) for name, call in asked.calls(world).items()}
            if on_the_way:
                time.sleep(dice.uniform(0, _BEGIN_S))
                ending.enter_context(self._enter(world, how))
            self._kill(victim)
            ends = time.monotonic() + dice.uniform(0, _STAY_S)
            while time.monotonic() < ends and not all(each.done() for each in waiting.values()):
                time.sleep(0.05)
        told = {name: each.result() for name, each in waiting.items()}
        row = self._table.rows[self._state, victim]
        row.rounds += 1
        refused, unknown = world.refused - refused, list(told.values()).count(None)
        row.told += collections.Counter(
            {"acknowledged": len(told) - unknown, "refused": refused, "no answer": unknown - refused}
        )
        for column, what in self._look(asked, told).items():
            row.wrong[column] += 1
            self._table.faults.append(f"{self._state} ({how}), {victim} killed: {column}: {what}")

    def _later(self, call: Callable[[], Any]) -> Any:
        time.sleep(self._dice.uniform(0, _BEGIN_S))
        return call()

    def _kill(self, victim: str) -> None:
        time.sleep(self._dice.uniform(0, _KILL_S))
        if victim != "nobody":
            self._world.kill(victim)
            self._world.revive(victim)

    def _look(self, asked: _Asked, told: dict[str, Any]) -> dict[str, str]:
        """What is wrong, now that all is well again and the clients ask again for what was refused."""
        world, calls = self._world, asked.calls(self._world)
        again = until(calls["job"], 60, "a job is acknowledged")
        found = check_job(world, _JOB, told["job"], again, self._weights)
        found |= check_dataset(world, asked.data, told["upload"])
        found |= check_move(world, _MOVED, asked.before, asked.to, told["move"])
        found |= self._look_at_retired(asked, told["retire"])
        return found | check_audit(world)

    def _look_at_retired(self, asked: _Asked, told: str | None) -> dict[str, str]:
        store, place = self._world.store, f"{_SPARE}@{asked.retired}"
        state, _ = store.version_state(_SPARE, asked.retired)
        if state not in ({asked.end} if told else {asked.end, "published"}):
            return {RETIRED: f"{place} is {state}, told was {told}"}
        if until(asked.calls(self._world)["retire"], 60, f"{place} is {asked.end}") != asked.end:
            return {RETIRED: f"{place} cannot be {asked.end}"}
        if asked.end == "archived":
            store.verify(_SPARE, asked.retired)
        else:
            manifest = store.manifest(_SPARE, asked.retired)
            with suppress(StoreError):
                store.read_file(manifest, "weights.safetensors")
                return {RETIRED: f"{place} is deleted, and its weights are there"}
        return {}


def _key(state: str, number: int) -> str:
    return f"{state} {number}".replace(" ", "-")


def run(rounds: int, seed: int, states: tuple[str, ...] = tuple(STATES), *, say: Any = None) -> Table:
    """The table of that many rounds in each of these states."""
    table, dice = Table(), random.Random(seed)
    say = say or functools.partial(print, file=sys.stderr, flush=True)
    began = time.monotonic()
    for state in states:
        with _world_of(state) as (world, enter):
            one = Rounds(world, enter, state, dice, table)
            first = dice.randrange(6)
            for number in range(rounds):
                how = STATES[state][(first + number) % len(STATES[state])]
                victim = _VICTIMS[(first // 2 + number + number // len(STATES[state])) % len(_VICTIMS)]
                known = len(table.faults)
                one.round(how, victim)
                passed = time.monotonic() - began
                say(
                    f"{passed:.0f} s: {state} {number + 1}/{rounds}: {how}, {victim}", *table.faults[known:], sep="\n  "
                )
            found = check_leftovers(world)
            table.faults += [f"at the end, {state}: {column}: {what}" for column, what in found.items()]
    table.seconds = time.monotonic() - began
    return table


def main() -> int:
    """Print the table; exit code 1 when anything was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=10, help="in each state")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--state", choices=tuple(STATES), action="append", help="only this one")
    asked = parser.parse_args()
    table = run(asked.rounds, asked.seed, tuple(asked.state or STATES))
    print(f"seed {asked.seed}, {table.seconds:.0f} s\n\n{table.markdown()}", end="")
    return 1 if table.faults else 0


if __name__ == "__main__":
    sys.exit(main())
