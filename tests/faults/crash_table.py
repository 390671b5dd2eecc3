"""The fault table: kill -9 of API, worker and database server at random moments of uploads and training jobs.

    python -m tests.faults.crash_table --kills 200 --seed 1

A round is one upload, one job or one alias moved by hand, and a kill in it: a random time into the phase that it aims
at, or anywhere in the job. What was killed is started again, the client asks again for what was not acknowledged, and
then everything that the round was to leave is looked at. Where a kill hit is what the worker last said it began.
"""

from __future__ import annotations

import argparse
import collections
import functools
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.api.chrono_uploads import archive
from tests.databases import start_postgres
from tests.faults.crash_checks import COLUMNS, check_audit, check_dataset, check_job, check_leftovers, check_move
from tests.faults.crash_world import Steps, World
from tests.jobs.nursery import Nursery, until

# What a step of the workflow is called in the table.
PHASES = {
    "waiting": "queueing",
    "prepare": "loading",
    "fit_chunk": "fitting",
    "evaluate": "evaluating",
    "publish": "publishing",
    "name_candidate": "candidate alias",
    "move_candidate": "candidate alias",
    "judge": "judging",
    "move_champion": "champion alias",
    "tidy": "tidying up",
    "leave": "recording the result, or later",
}
BY_HAND = "alias moved by hand"
ORDER = ("upload", *dict.fromkeys(PHASES.values()), BY_HAND)
_STEPS = tuple(step for step in PHASES if step != "waiting")
AIMS = {
    "api": ("upload",) * 5 + ("queueing",) * 3 + (BY_HAND,) * 3 + (*_STEPS, "anywhere"),
    "worker": ("upload", "queueing", BY_HAND, *_STEPS, "anywhere"),
    "database": ("upload", "queueing", "queueing", BY_HAND, *_STEPS, "anywhere"),
}
SHARES = {"sqlite": {"api": 3, "worker": 5}, "postgresql": {"api": 3, "worker": 4, "database": 4}}
_JOB = {"datasets": ["unit"], "split": {"test_slopes_deg": [12]}, "promote": "if_better", "margin": 0.01}
MOVED_BY_HAND = "rover-0@by-hand"
# In turn for each model, and whether champion moves to it: it is the first, better, worse, better.
CONFIGS = (
    {"architecture": "zero", "prior": "rigid_slope"},
    {"architecture": "paper_network", "prior": "motor_slope", "budget": {"max_epochs": 60}},
    {"architecture": "paper_network", "prior": "rigid_slope", "budget": {"max_epochs": 12}},
    {"architecture": "drive_model"},
)
_PROMOTED = (True, True, False, True)
_LONGEST_PAUSE_S = 0.3
_TWICE = 0.2  # share of jobs that meet a second kill while they recover from the first


@dataclass
class Row:
    """One line of the table."""

    kills: collections.Counter[str] = field(default_factory=collections.Counter)
    wrong: collections.Counter[str] = field(default_factory=collections.Counter)


@dataclass
class Table:
    """Who was killed during what, and what came of it."""

    rows: dict[tuple[str, str], Row] = field(default_factory=lambda: collections.defaultdict(Row))
    faults: list[str] = field(default_factory=list)
    uploads: int = 0
    jobs: int = 0
    moves: int = 0
    seconds: float = 0.0

    def count(self, victim: str, phase: str, engine: str, found: dict[str, str]) -> None:
        """A kill, and what was wrong after it: column -> what exactly."""
        row = self.rows[victim, phase]
        row.kills[engine] += 1
        for column, what in found.items():
            row.wrong[column] += 1
            self.faults.append(f"{victim} killed during {phase} on {engine}: {column}: {what}")

    @property
    def kills(self) -> int:
        return sum(row.kills.total() for row in self.rows.values())

    def markdown(self) -> str:
        """The table as it goes into documents."""
        engines = tuple(SHARES)
        lines = [
            f"| killed | during | {' | '.join(engines)} | {' | '.join(COLUMNS)} |",
            "|" + "---|" * (2 + len(engines) + len(COLUMNS)),
        ]
        total = Row()
        for victim, phase in sorted(self.rows, key=lambda key: (list(AIMS).index(key[0]), ORDER.index(key[1]))):
            row = self.rows[victim, phase]
            total.kills += row.kills
            total.wrong += row.wrong
            lines.append(_line(victim, phase, row))
        lines.append(_line("**all**", f"{self.uploads} uploads, {self.jobs} jobs, {self.moves} moves", total))
        return "\n".join([*lines, "", *(f"- {fault}" for fault in self.faults)]).rstrip() + "\n"


def _line(victim: str, phase: str, row: Row) -> str:
    numbers = [row.kills[engine] for engine in SHARES] + [row.wrong[column] for column in COLUMNS]
    return f"| {victim} | {phase} | {' | '.join(map(str, numbers))} |"


class Executioner:
    """Rounds in one world."""

    def __init__(self, world: World, engine: str, dice: random.Random, table: Table) -> None:
        self._world = world
        self._engine = engine
        self._dice = dice
        self._table = table
        self._jobs = 0
        self._weights: dict[int, str] = {}
        self._upload_s = 2.0
        self._submit_s = 0.05
        self._move_s = 0.02
        self._job_s = 2.0

    def learn(self) -> None:
        """One undisturbed upload and one job of each kind: how long things take, and the weights to expect."""
        began = time.monotonic()
        uploaded = self._world.upload(self._new_archive())
        assert uploaded is not None
        self._upload_s = time.monotonic() - began
        for config in range(len(CONFIGS)):
            self._world.steps.forget()
            began = time.monotonic()
            job_id = self._world.submit(self._request(), f"{self._engine}-{self._jobs}")
            self._submit_s = time.monotonic() - began
            assert job_id
            job = self._world.ended(job_id)
            assert job is not None
            assert job.result is not None, job.failure
            assert job.result.promoted is _PROMOTED[config], job.result.comparison
            self._job_s = time.monotonic() - began
            self._world.steps.learn()
            manifest = self._world.store.manifest(job.result.model, job.result.version)
            self._weights[config] = manifest.files["weights.safetensors"].sha256
            self._jobs += 1
        began = time.monotonic()
        assert self._world.move(MOVED_BY_HAND, 1, 0) == 1
        self._move_s = time.monotonic() - began

    def round(self, victim: str, aim: str) -> None:
        """One kill and the look at what it left."""
        if aim == "upload":
            phases, found = self._upload_round(victim)
        elif aim == BY_HAND:
            phases, found = self._move_round(victim)
        else:
            phases, found = self._job_round(victim, aim)
        found |= check_audit(self._world)
        for number, phase in enumerate(phases):
            self._table.count(victim, phase, self._engine, {} if number else found)

    # ---- an upload

    def _new_archive(self) -> bytes:
        self._table.uploads += 1
        return archive(seed=1e-4 * self._table.uploads)

    def _upload_round(self, victim: str) -> tuple[list[str], dict[str, str]]:
        data = self._new_archive()
        pause_s = self._dice.choice((0.0, self._dice.uniform(0, 0.3)))
        with ThreadPoolExecutor(1) as pool:
            sent = pool.submit(self._world.upload, data, pause_s)
            time.sleep(self._dice.uniform(0, 1.1 * (self._upload_s + pause_s)))
            self._kill(victim)
            acknowledged = sent.result()
        return ["upload"], check_dataset(self._world, data, acknowledged)

    # ---- an alias

    def _move_round(self, victim: str) -> tuple[list[str], dict[str, str]]:
        """Somebody points an alias of his own to one of the versions of the first model."""
        self._table.moves += 1
        before = self._world.moves_of(MOVED_BY_HAND)
        version = self._dice.choice([each for each in (1, 2, 3, 4) if each != before[-1].version])
        with ThreadPoolExecutor(1) as pool:
            sent = pool.submit(self._world.move, MOVED_BY_HAND, version, len(before))
            time.sleep(self._dice.uniform(0, 1.5 * self._move_s))
            self._kill(victim)
            acknowledged = sent.result()
        return [BY_HAND], check_move(self._world, MOVED_BY_HAND, before, version, acknowledged)

    # ---- a job

    def _request(self) -> dict[str, Any]:
        return _JOB | CONFIGS[self._jobs % len(CONFIGS)] | {"model": f"rover-{self._jobs // len(CONFIGS)}"}

    def _job_round(self, victim: str, aim: str) -> tuple[list[str], dict[str, str]]:
        steps, config = self._world.steps, self._jobs % len(CONFIGS)
        request, key = self._request(), f"{self._engine}-{self._jobs}"
        if aim == "move_champion" and not _PROMOTED[config]:
            aim = "judge"
        self._jobs += 1
        self._table.jobs += 1
        steps.forget()
        with ThreadPoolExecutor(1) as pool:
            sent = pool.submit(self._world.submit, request, key)
            if aim == "queueing":
                # until it is taken up, after which it no longer waits
                time.sleep(self._dice.uniform(0, self._submit_s + (0.1 if victim == "worker" else 0.02)))
            elif aim == "anywhere":
                time.sleep(self._dice.uniform(0, self._job_s))
            elif steps.wait_for(aim, 30):
                time.sleep(self._dice.uniform(0, 1.1 * steps.length_s(aim)))
            phases = [PHASES[steps.present()]]
            self._kill(victim)
            if self._dice.random() < _TWICE:
                time.sleep(self._dice.uniform(0, self._job_s))
                phases.append(PHASES[steps.present()])
                self._kill(victim)
            acknowledged = sent.result()
        again = until(lambda: self._world.submit(request, key), 30, "a job is acknowledged")
        return phases, check_job(self._world, request, acknowledged, again, self._weights[config])

    def _kill(self, victim: str) -> None:
        self._world.kill(victim)
        time.sleep(self._dice.choice((0.0, self._dice.uniform(0, _LONGEST_PAUSE_S))))
        self._world.revive(victim)


def run(kills: int, seed: int, engines: tuple[str, ...] = tuple(SHARES), *, say: Any = None) -> Table:
    """The table of that many kills over these engines."""
    table, dice = Table(), random.Random(seed)
    say = say or functools.partial(print, file=sys.stderr, flush=True)
    began = time.monotonic()
    shares = {(engine, victim): share for engine in engines for victim, share in SHARES[engine].items()}
    steps = Steps()
    with Nursery(apis=True, heard=steps.heard) as nursery:
        for engine in engines:
            counts = {victim: kills * shares[engine, victim] / sum(shares.values()) for victim in SHARES[engine]}
            with _world(engine, nursery, steps) as world:
                executioner = Executioner(world, engine, dice, table)
                executioner.learn()
                plan = _plan(counts, dice)
                for number, (victim, aim) in enumerate(plan, 1):
                    known = len(table.faults)
                    executioner.round(victim, aim)
                    say(f"{engine} {number}/{len(plan)}: {victim}, {aim}", *table.faults[known:], sep="\n  ")
                found = check_leftovers(world)
                table.faults += [f"at the end on {engine}: {column}: {what}" for column, what in found.items()]
    table.seconds = time.monotonic() - began
    return table


def _plan(counts: dict[str, float], dice: random.Random) -> list[tuple[str, str]]:
    """Victims and aims in random order, every aim of a victim about as often as it stands in `AIMS`."""
    plan = []
    for victim, count in counts.items():
        first = dice.randrange(len(AIMS[victim]))
        plan += [(victim, AIMS[victim][(first + each) % len(AIMS[victim])]) for each in range(max(1, round(count)))]
    dice.shuffle(plan)
    return plan


@contextmanager
def _world(engine: str, nursery: Nursery, steps: Steps) -> Iterator[World]:
    with ExitStack() as stack:
        folder = Path(tempfile.mkdtemp(prefix="crash-"))
        stack.callback(shutil.rmtree, folder, ignore_errors=True)
        postgres = stack.enter_context(contextmanager(start_postgres)()) if engine == "postgresql" else None
        yield stack.enter_context(World(folder, nursery, steps, postgres))


def main() -> int:
    """Print the table; exit code 1 when anything was wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    table = run(asked.kills, asked.seed)
    print(f"{table.kills} kills, seed {asked.seed}, {table.seconds:.0f} s\n\n{table.markdown()}", end="")
    return 1 if table.faults else 0


if __name__ == "__main__":
    sys.exit(main())
