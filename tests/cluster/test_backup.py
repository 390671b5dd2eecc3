"""The commands of docs/operating.md, as they stand there, on a store and a database that are in use."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from model_store import ModelStore
from service.jobs.queue import JobQueue
from service.jobs.request import TrainingJobRequest
from tests.databases import start_postgres
from tests.jobs.nursery import Nursery
from tests.training.stored import put_dataset, stored_runs

pytestmark = [pytest.mark.processes, pytest.mark.slow]

PAGE = Path(__file__).parents[2] / "docs" / "operating.md"
ROOT = Path(__file__).parents[2]
_REQUEST = TrainingJobRequest(
    model="rover", datasets=("unit",), architecture="zero", prior="rigid_slope", split={"test_slopes_deg": [12]}
)


def commands(anchor: str) -> str:
    """The block of the page after that anchor."""
    _, _, rest = PAGE.read_text().partition(f'<a id="{anchor}"></a>')
    found = re.search(r"```sh\n(.*?)```", rest, re.DOTALL)
    assert found
    return found[1]


def shell(block: str, **variables: object) -> None:
    """Run a block as an operator does, with `rover-twin` and the tools of PostgreSQL on the path."""
    path = [str(Path(sys.executable).parent), os.environ["PATH"]]
    if found := importlib.util.find_spec("pgserver"):
        path.insert(0, str(Path(str(found.origin)).parent / "pginstall" / "bin"))
    given = os.environ | {name: str(each) for name, each in variables.items()}
    given |= {"PATH": os.pathsep.join(path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["sh", "-euc", block], env=given, capture_output=True, text=True, check=False, timeout=120, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr


def work(nursery: Nursery, store: Path, url: str) -> None:
    """One worker, until no job is left."""
    assert nursery.start(store, url, once=True).wait(120) == 0


@contextmanager
def databases(engine: str, folder: Path) -> Iterator[tuple[str, str]]:
    """The addresses of a database and of an empty one."""
    if engine == "sqlite":
        yield tuple(f"sqlite:///{folder / name / 'jobs' / 'jobs.sqlite'}" for name in ("old", "new"))
        return
    with contextmanager(start_postgres)() as server:
        yield server.new_database(), server.new_database()


@pytest.mark.parametrize("engine", ["sqlite", "postgresql"])
def test_a_backup_taken_in_the_middle_of_work_is_restored_whole(engine, tmp_path):
    backup, old, new = (tmp_path / name for name in ("backup", "old", "new"))
    backup.mkdir()
    store = ModelStore.open(old, create=True)
    put_dataset(store, "unit", stored_runs())
    dump, _, copy = commands(f"backup-of-{engine}").strip().partition("\n")
    with databases(engine, tmp_path) as (url, new_url), Nursery() as nursery:
        queue = JobQueue.open(url, 10)
        first = queue.submit(_REQUEST, actor="tests", key="first")[0]
        work(nursery, old, url)
        waiting = queue.submit(_REQUEST, actor="tests", key="second")[0]
        places = {"ROVER_TWIN_STORE_URL": old, "ROVER_TWIN_JOBS_DATABASE_URL": url, "BACKUP": backup}
        shell(dump, **places)
        work(nursery, old, url)  # it ends between the two commands
        lost = queue.submit(_REQUEST, actor="tests", key="third")[0]
        shell(copy, **places)
        queue.close()

        shell(commands(f"restore-of-{engine}"), BACKUP=backup, NEW_STORE_URL=new, NEW_DATABASE_URL=new_url)

        restored = JobQueue.open(new_url, 10)
        states = {job.id: job.state for job in restored.list()}
        assert states == {first.id: "succeeded", waiting.id: "queued"}
        assert lost.id not in states
        work(nursery, new, new_url)
        jobs = [restored.get(job.id) for job in (first, waiting)]
        restored.close()
    copied = ModelStore.open(new)
    assert [job.result.version for job in jobs if job.result] == [1, 2] == copied.versions("rover")
    for version in copied.versions("rover"):
        assert copied.verify("rover", version) == store.manifest("rover", version)
    assert copied.alias_history("rover", "candidate") == store.alias_history("rover", "candidate")
