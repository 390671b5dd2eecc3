"""Kill the writer at any moment, many times: a reader never sees half of anything, and nothing acknowledged is lost.

Run as a program this file is the *nursery*: it imports the store once and forks a writer per line on stdin, so that
dozens of kills take seconds. It forks before any store is opened, because the runtime under obstore has threads.
"""

from __future__ import annotations

import hashlib
import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from model_store import DatasetDraft, Lineage, ManifestDraft, ModelNotFoundError, ModelStore

pytestmark = pytest.mark.kills

KILLS = 60
LONGEST_DELAY_S = 0.06
WEIGHTS_BYTES = 3_000_000
BY = {"actor": "writer", "reason": "as often as it can"}

needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="SIGKILL and fork are POSIX")


# ---- the writers: each acknowledges on stdout what the store has confirmed


def acknowledge(*words):
    os.write(1, (" ".join(map(str, words)) + "\n").encode())


def weights_of(tag):
    return tag.encode().ljust(WEIGHTS_BYTES, b".")


def draft_of(tag):
    return ManifestDraft(created_by=tag, checkpoint={}, domain={}, metrics={}, lineage=Lineage())


def publish_for_ever(store, life):
    for count in itertools.count():
        tag = f"{life}-{count}"
        files = {"weights.safetensors": weights_of(tag), "report/tag.txt": tag.encode()}
        acknowledge("ack", store.publish("viper", files, draft_of(tag)).version, tag)


def move_for_ever(store, life):
    for count in itertools.count():
        tag = f"{life}-{count}"
        moved = store.move_alias("viper", "champion", 1 + count % 3, actor=tag, reason="again")
        acknowledge("ack", moved.seq, tag)


def dataset_files(number):
    return {"passport.json": b"{}", "runs.parquet": weights_of(f"runs {number}")}


def dataset_id(number):
    return hashlib.sha256(str(number).encode()).hexdigest()


def put_for_ever(store, life):
    # every life begins at the first dataset again: what it meets is whole, half written, or not there
    for number in itertools.count(max(0, life // 2 - 2)):
        record = store.put_dataset(dataset_id(number), dataset_files(number), DatasetDraft(name="set", created_by="w"))
        acknowledge("ack", number, record.id)


WRITERS = {"publish": publish_for_ever, "move": move_for_ever, "dataset": put_for_ever}


def nursery(kind, url):
    for life, _ in enumerate(sys.stdin):
        writer = os.fork()
        if writer == 0:
            store = ModelStore.open(url)
            store.model_names()
            acknowledge("alive", os.getpid())
            WRITERS[kind](store, life)
        os.waitpid(writer, 0)
        acknowledge("dead", writer)


# ---- the one who kills, and the one who reads


class Slaughter:
    """Starts writers, kills each after a seeded random delay, and collects what they acknowledged."""

    def __init__(self, kind, url):
        root = Path(__file__).parents[2]
        self.nursery = subprocess.Popen(
            [sys.executable, __file__, kind, str(url)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(root)},
        )
        self.acknowledged = []

    def run(self, kills):
        delays = random.Random(20230923)
        try:
            for life in range(kills):
                self.nursery.stdin.write("one more\n")
                self.nursery.stdin.flush()
                alive, pid = self.nursery.stdout.readline().split()
                assert alive == "alive"
                if life % 2:  # half of them finish something first, however slow the machine
                    self._note(self.nursery.stdout.readline())
                time.sleep(delays.uniform(0, LONGEST_DELAY_S))
                os.kill(int(pid), signal.SIGKILL)
                self._collect()
        finally:
            self.nursery.kill()
            self.nursery.wait()
            self.nursery.stdin.close()
            self.nursery.stdout.close()

    def _collect(self):
        for line in self.nursery.stdout:
            if line.startswith("dead"):
                return
            self._note(line)
        pytest.fail("the nursery died")

    def _note(self, line):
        word, number, tag = line.split()
        assert word == "ack"
        self.acknowledged.append((int(number), tag))


class Reader(threading.Thread):
    """Looks at the store without a pause, until stopped; remembers the first thing that went wrong."""

    def __init__(self, look):
        super().__init__()
        self.look = look
        self.looks = 0
        self.wrong = None
        self.stopped = threading.Event()

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *error):
        self.stopped.set()
        self.join()

    def run(self):
        while not self.stopped.is_set() and self.wrong is None:
            try:
                self.look()
                self.looks += 1
            except Exception as error:
                self.wrong = error

    def saw_nothing_wrong(self):
        if self.wrong is not None:
            raise self.wrong
        assert self.looks > 20


def verify_whole(store, version):
    manifest = store.verify("viper", version)
    assert store.read_file(manifest, "weights.safetensors") == weights_of(manifest.created_by)
    assert store.read_file(manifest, "report/tag.txt").decode() == manifest.created_by
    return manifest


@pytest.fixture
def place(tmp_path):
    yield tmp_path
    shutil.rmtree(tmp_path)  # hundreds of megabytes, of no use once the test has looked


@needs_fork
def test_a_publisher_killed_at_any_moment_leaves_only_whole_versions(place):
    store = ModelStore.open(place)
    slaughter = Slaughter("publish", place)
    seen: list[int] = []

    def look():
        try:
            versions = store.versions("viper")
        except ModelNotFoundError:
            assert not seen
            return
        assert set(seen) <= set(versions), "a version vanished"
        for version in versions:
            if version not in seen or version == versions[-1]:
                verify_whole(store, version)
                assert store.resolve(f"viper@{version}").version == version
        seen[:] = versions

    with Reader(look) as reader:
        slaughter.run(KILLS)
    reader.saw_nothing_wrong()
    published = store.versions("viper")
    whole = {version: verify_whole(store, version).created_by for version in published}
    assert slaughter.acknowledged, "no writer ever lived long enough"
    assert whole.items() >= dict(slaughter.acknowledged).items(), "an acknowledged version is lost or another's"
    begun = {int(folder.name) for folder in (place / "models/viper/versions").iterdir()}
    assert begun - set(published), "no kill fell into the middle of a publication: the test proves nothing"

    after = store.publish("viper", {"weights.safetensors": b"after"}, draft_of("after"))
    assert after.version == max(begun) + 1
    assert store.verify("viper", after.version) == after


@needs_fork
def test_a_mover_killed_at_any_moment_leaves_only_whole_records(place):
    store = ModelStore.open(place)
    for number in range(3):
        store.publish("viper", {"weights.safetensors": b"w"}, draft_of(str(number)))
    store.move_alias("viper", "champion", 1, **BY)
    slaughter = Slaughter("move", place)
    last = [1]

    def look():
        assert store.resolve("viper").version in (1, 2, 3)
        current = store.alias("viper", "champion")
        assert current.seq >= last[0], "the alias went back in time"
        last[0] = current.seq

    with Reader(look) as reader:
        slaughter.run(KILLS)
    reader.saw_nothing_wrong()
    history = store.alias_history("viper", "champion")
    assert [record.seq for record in history] == list(range(1, len(history) + 1))
    recorded = {record.seq: record.actor for record in history}
    assert slaughter.acknowledged
    assert recorded.items() >= dict(slaughter.acknowledged).items()

    store.move_alias("viper", "champion", 1, **BY)
    assert store.move_alias("viper", "champion", 2, **BY).seq == len(history) + 2
    assert store.rollback("viper", "champion", **BY).version == 1


@needs_fork
def test_a_dataset_writer_killed_at_any_moment_leaves_only_whole_datasets(place):
    store = ModelStore.open(place)
    slaughter = Slaughter("dataset", place)
    numbers = {dataset_id(number): number for number in range(1000)}
    seen: set[str] = set()

    def verify_dataset(found):
        for file, content in dataset_files(numbers[found]).items():
            assert store.read_dataset_file(found, file) == content

    def look():
        found = store.dataset_ids()
        assert seen <= set(found), "a dataset vanished"
        for one in set(found) - seen:
            verify_dataset(one)
        seen.update(found)

    with Reader(look) as reader:
        slaughter.run(KILLS)
    reader.saw_nothing_wrong()
    found = store.dataset_ids()
    for one in found:
        verify_dataset(one)
    assert slaughter.acknowledged
    assert set(found) >= {one for _, one in slaughter.acknowledged}
    begun = {folder.name for folder in (place / "datasets").iterdir()}
    for one in begun:
        store.put_dataset(one, dataset_files(numbers[one]), DatasetDraft(name="set", created_by="after"))
    assert set(store.dataset_ids()) == begun


if __name__ == "__main__":
    nursery(*sys.argv[1:])
