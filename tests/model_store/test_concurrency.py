"""Many processes, one directory: everybody gets their own version, one mover wins each record."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import pytest

import model_store
from model_store import ConflictError, DatasetDraft, ModelStore

PROCESSES = 8
BY = {"actor": "tests", "reason": "because"}

CHILD = """
import json, sys
from model_store import ConflictError, DatasetDraft, Lineage, ManifestDraft, ModelStore, VersionRetiredError

(me,) = sys.argv[1:]
draft = ManifestDraft(created_by=me, checkpoint={}, domain={}, metrics={}, lineage=Lineage())


def publish(store):
    files = {"weights.safetensors": me.encode() * 100_000, "report/me.txt": me.encode()}
    return [store.publish("viper", files, draft).version for _ in range(3)]


def move(store):
    return [store.move_alias("viper", "champion", 1, actor=me, reason="").seq for _ in range(5)]


def expect(store):
    try:
        return [store.move_alias("viper", "champion", 1, actor=me, reason="", expected_seq=1).seq]
    except ConflictError:
        return []


def contend(store):
    won = []
    for alias in ["champion", "candidate"] * 4:
        try:
            if int(me[-1]) % 2:
                won.append(store.move_alias("viper", alias, 2, actor=me, reason="").version)
                store.move_alias("viper", alias, 1, actor=me, reason="")
            else:
                store.archive_version("viper", 2, actor=me, reason="")
                won.append(sorted(store.retired("viper")))
                store.restore_version("viper", 2, actor=me, reason="")
        except (ConflictError, VersionRetiredError):
            pass
        for record in store.aliases("viper").values():
            store.manifest("viper", record.version)
    return won


def dataset(store):
    files = {"runs.parquet": b"PAR1" * 100_000, "passport.json": b"{}"}
    return store.put_dataset("a" * 64, files, DatasetDraft(name=me, created_by=me)).created_by


for line in sys.stdin:
    action, url = json.loads(line)
    store = ModelStore.open(url)
    store.model_names()
    print("ready", flush=True)
    sys.stdin.readline()
    print(json.dumps(globals()[action](store)), flush=True)
"""


@pytest.fixture(scope="module")
def children(processes):
    """Eight processes that wait for something to do."""
    environment = {**os.environ, "PYTHONPATH": str(Path(model_store.__file__).parents[1])}
    with ExitStack() as stack:
        children = [
            stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", CHILD, f"child-{number}"],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    text=True,
                    env=environment,
                )
            )
            for number in range(PROCESSES)
        ]
        yield children
        for child in children:
            child.stdin.close()
        assert [child.wait(60) for child in children] == [0] * PROCESSES


@pytest.fixture
def together(children, directory):
    """Lets all of them do one thing to the store at the same moment; gives what each reported."""

    def do(action):
        for line, heard in ((json.dumps([action, str(directory)]), "ready\n"), ("go", None)):
            for child in children:
                child.stdin.write(f"{line}\n")
                child.stdin.flush()
            said = [child.stdout.readline() for child in children]
            assert heard is None or said == [heard] * PROCESSES
        return [json.loads(each) for each in said]

    return do


def test_publishers_at_once_get_distinct_whole_versions(store, together):
    reports = together("publish")
    versions = [version for report in reports for version in report]
    assert sorted(versions) == store.versions("viper")
    assert len(set(versions)) == 3 * PROCESSES
    for number, report in enumerate(reports):
        assert report == sorted(report)
        for version in report:
            manifest = store.verify("viper", version)
            assert manifest.created_by == f"child-{number}"
            assert store.read_file(manifest, "report/me.txt") == f"child-{number}".encode()


def test_movers_at_once_are_all_recorded(store, together, files, draft):
    store.publish("viper", files, draft)
    reports = together("move")
    assert sorted(seq for report in reports for seq in report) == list(range(1, 5 * PROCESSES + 1))
    history = store.alias_history("viper", "champion")
    for number, report in enumerate(reports):
        assert [record.seq for record in history if record.actor == f"child-{number}"] == report


def test_of_movers_who_expect_the_same_record_one_wins(store, together, files, draft):
    store.publish("viper", files, draft)
    store.move_alias("viper", "champion", 1, **BY)
    reports = together("expect")
    assert sorted(reports, key=len) == [[]] * (PROCESSES - 1) + [[2]]
    winner = reports.index([2])
    assert store.alias("viper", "champion").actor == f"child-{winner}"


def test_movers_and_those_who_retire_at_once_leave_every_alias_on_a_usable_version(store, together, files, draft):
    for _ in range(2):
        store.publish("viper", files, draft)
    reports = together("contend")
    assert any(reports)
    for alias, record in store.aliases("viper").items():
        assert store.resolve(f"viper@{alias}").version == record.version
        store.require_usable("viper", record.version)


def test_one_dataset_put_by_many_at_once_is_one_dataset(store, together):
    reports = together("dataset")
    assert set(reports) == {store.dataset("a" * 64).created_by}
    assert store.read_dataset_file("a" * 64, "runs.parquet") == b"PAR1" * 100_000


@pytest.mark.parametrize("url", ["memory://", "directory"])
def test_threads_share_one_store(url, directory, files, draft):
    store = ModelStore.open(directory if url == "directory" else url, create=True)
    store.publish("viper", files, draft)
    for version in (2, 3):
        store.publish("viper", files, draft)
        store.move_alias("viper", "champion", version, **BY)
    outcomes = []

    def work(number):
        outcomes.append(store.publish("viper", files, draft).version)
        store.put_dataset("a" * 64, {"x": b"x"}, DatasetDraft(name="x", created_by=str(number)))
        try:
            outcomes.append(f"rolled to {store.rollback('viper', 'champion', expected_seq=2, **BY).version}")
        except ConflictError:
            outcomes.append("conflict")

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes.count("rolled to 2") == 1
    assert outcomes.count("conflict") == 7
    assert store.versions("viper") == list(range(1, 12))
