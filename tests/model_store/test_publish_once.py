"""Publishing once: in whatever order publishers do their steps, and whoever dies in between, one version per key."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from obstore.store import MemoryStore

import model_store
from model_store import CorruptArtefactError, InvalidReferenceError, Lineage, ManifestDraft, ModelStore
from model_store.backend import Backend

WAIT_S = 20
KEYS = ("job-a", "job-b")


def draft_of(tag, key=None):
    return ManifestDraft(created_by=tag, checkpoint={}, domain={}, metrics={}, lineage=Lineage(job=key))


def files_of(tag):
    return {"weights.safetensors": tag.encode() * 100, "report/tag.txt": tag.encode()}


def published_under(store, key):
    """Every version made for a key, each verified to be whole and of one publisher only."""
    names = store.versions("rover") if "rover" in store.model_names() else []
    manifests = [store.verify("rover", version) for version in names]
    for manifest in manifests:
        tag = manifest.created_by
        for file, content in files_of(tag).items():
            assert store.read_file(manifest, file) == content
    return [manifest for manifest in manifests if manifest.lineage.job == key]


# ---- one step of one publisher at a time, in any order


class Killed(BaseException):
    """The end of a publisher: nothing after it runs, as after a SIGKILL."""


class SteppedBackend(Backend):
    """Stops before every operation until the test allows it, or kills the publisher before or after it."""

    def __init__(self, objects):
        super().__init__(objects, "stepped")
        self.stopped, self.order, self.go_on = threading.Event(), "step", threading.Event()

    def _stepped(self, operation, *arguments, **named):
        self.stopped.set()
        assert self.go_on.wait(WAIT_S)
        self.go_on.clear()
        if self.order == "kill before":
            raise Killed
        result = operation(*arguments, **named)
        if self.order == "kill after":
            raise Killed
        return result

    def create(self, key, data):
        return self._stepped(super().create, key, data)

    def read(self, key, *, limit_bytes):
        return self._stepped(super().read, key, limit_bytes=limit_bytes)

    def exists(self, key):
        return self._stepped(super().exists, key)

    def folders(self, prefix):
        return self._stepped(super().folders, prefix)

    def keys(self, prefix):
        return self._stepped(super().keys, prefix)


class Publisher(threading.Thread):
    """One attempt to publish under a key, made step by step."""

    def __init__(self, objects, key, tag):
        super().__init__(daemon=True)
        self.backend, self.key, self.tag = SteppedBackend(objects), key, tag
        self.manifest, self.error, self.ended = None, None, False
        self.start()
        assert self.backend.stopped.wait(WAIT_S)

    def run(self):
        try:
            store = ModelStore(self.backend)
            self.manifest = store.publish("rover", files_of(self.tag), draft_of(self.tag, self.key), once_key=self.key)
        except Killed:
            pass
        except Exception as error:
            self.error = error
        self.ended = True
        self.backend.stopped.set()

    def obey(self, order):
        """Do one operation (or die around it) and stop before the next; the ended ignore everything."""
        if self.ended:
            return
        self.backend.order = order
        self.backend.stopped.clear()
        self.backend.go_on.set()
        assert self.backend.stopped.wait(WAIT_S)

    def finish(self):
        while not self.ended:
            self.obey("step")
        self.join(WAIT_S)


ORDERS = st.sampled_from(["step"] * 12 + ["kill before", "kill after"])


@pytest.mark.slow
@settings(max_examples=300, deadline=None, derandomize=True, database=None)
@given(
    keys=st.lists(st.sampled_from(KEYS), min_size=2, max_size=5),
    schedule=st.lists(st.tuples(st.integers(0, 4), ORDERS), max_size=70),
)
@example(keys=["job-a"] * 2, schedule=[(0, "step")] * 5 + [(0, "kill after")] + [(1, "step")] * 20)
def test_any_interleaving_with_any_deaths_gives_one_version_per_key(keys, schedule):
    objects = MemoryStore()
    reader = ModelStore(Backend(objects, "memory"))
    publishers = [Publisher(objects, key, f"{key} by {number}") for number, key in enumerate(keys)]
    for who, order in schedule:
        publishers[who % len(publishers)].obey(order)
        for key in KEYS:
            found = published_under(reader, key)
            assert len(found) <= 1
            assert reader.published_once("rover", key) == (found[0] if found else None)
    for publisher in publishers:
        publisher.finish()
        assert publisher.error is None
    for key in set(keys):
        last = reader.publish("rover", files_of("last"), draft_of("last", key), once_key=key)
        assert published_under(reader, key) == [last]
        assert reader.published_once("rover", key) == last
        told = [publisher.manifest for publisher in publishers if publisher.key == key and publisher.manifest]
        assert told == [last] * len(told)


@pytest.mark.parametrize("order", ["kill before", "kill after"])
def test_killed_at_every_single_step_the_next_attempt_publishes_the_one_version(order):
    attempts = set()
    for steps in range(30):
        objects = MemoryStore()
        first = Publisher(objects, "job-a", "first")
        for _ in range(steps):
            first.obey("step")
        first.obey(order)
        done_before_the_kill = first.manifest is not None
        first.finish()
        reader = ModelStore(Backend(objects, "memory"))
        again = reader.publish("rover", files_of("again"), draft_of("again", "job-a"), once_key="job-a")
        assert published_under(reader, "job-a") == [again]
        attempts.add(again.created_by)
        if done_before_the_kill:
            assert again == first.manifest
            assert attempts == {"first", "again"}, "no kill fell on each side of the decision: this proves nothing"
            return
    pytest.fail("the publisher never finished")


# ---- real threads and real processes


@pytest.mark.slow
@pytest.mark.parametrize("url", ["memory://", "directory"])
def test_threads_at_once_publish_once(url, directory):
    store = ModelStore.open(directory if url == "directory" else url, create=True)
    told, start = [], threading.Barrier(8)

    def work(number):
        start.wait(WAIT_S)
        for round_number in range(5):
            key = f"job-{round_number}"
            told.append((key, store.publish("rover", files_of(f"t{number}"), draft_of(f"t{number}", key), key)))

    threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(told) == 40
    assert len(store.versions("rover")) == 5
    for key, manifest in told:
        assert published_under(store, key) == [manifest]


CHILD = """
import json, sys
from model_store import Lineage, ManifestDraft, ModelStore

url, me = sys.argv[1:]
store = ModelStore.open(url)
store.model_names()
print("ready", flush=True)
sys.stdin.readline()
told = {}
for key in ("job-0", "job-1", "job-2"):
    draft = ManifestDraft(created_by=me, checkpoint={}, domain={}, metrics={}, lineage=Lineage(job=key))
    files = {"weights.safetensors": me.encode() * 100, "report/tag.txt": me.encode()}
    told[key] = store.publish("rover", files, draft, once_key=key).version
print(json.dumps(told))
"""


@pytest.mark.processes
def test_processes_at_once_publish_once(directory):
    store = ModelStore.open(directory, create=True)
    environment = {**os.environ, "PYTHONPATH": str(Path(model_store.__file__).parents[1])}
    children = [
        subprocess.Popen(
            [sys.executable, "-c", CHILD, str(directory), f"child-{number}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        for number in range(6)
    ]
    try:
        for child in children:
            assert child.stdout.readline() == "ready\n"
        for child in children:
            child.stdin.write("go\n")
            child.stdin.flush()
        told = [json.loads(child.communicate(timeout=60)[0]) for child in children]
    finally:
        for child in children:
            child.kill()
            child.wait()
            child.stdin.close()
            child.stdout.close()
    for key in ("job-0", "job-1", "job-2"):
        (manifest,) = published_under(store, key)
        assert [each[key] for each in told] == [manifest.version] * 6


# ---- the rest of the promise


def test_a_key_belongs_to_one_model_and_without_a_key_every_publication_is_new(store):
    assert store.published_once("rover", "job-a") is None
    first = store.publish("rover", files_of("x"), draft_of("x"), once_key="job-a")
    assert store.publish("rover", files_of("y"), draft_of("y"), once_key="job-a") == first
    assert store.publish("rover", files_of("y"), draft_of("y")).version == 2
    assert store.publish("other", files_of("z"), draft_of("z"), once_key="job-a").name == "other"
    assert store.versions("rover") == [1, 2]
    assert store.model_names() == ["other", "rover"]


@pytest.mark.parametrize("key", ["", "Job", "../1", "a/b", "a" * 129, ".a", "a\n", "é"])
def test_a_key_that_is_no_file_name_is_refused(store, key):
    with pytest.raises(InvalidReferenceError, match="once_key"):
        store.publish("rover", files_of("x"), draft_of("x"), once_key=key)
    with pytest.raises(InvalidReferenceError, match="once_key"):
        store.published_once("rover", key)
    assert store.model_names() == []


def _truncate(folder):
    record = folder / "models/rover/once/job-a.json"
    record.write_bytes(record.read_bytes()[:-20])


def _remove_weights_and_manifest(folder):
    for file in ("manifest.json", "weights.safetensors"):
        (folder / "models/rover/versions/1" / file).unlink()


def _alter_manifest(folder):
    manifest = folder / "models/rover/versions/1/manifest.json"
    manifest.write_text(manifest.read_text().replace('"first"', '"other"'))


@pytest.mark.parametrize("damage", [_truncate, _remove_weights_and_manifest, _alter_manifest])
def test_damage_is_an_error_and_never_a_second_version(store, directory, damage):
    store.publish("rover", files_of("first"), draft_of("first"), once_key="job-a")
    damage(directory)
    before = sorted(path.name for path in (directory / "models/rover/versions").rglob("*"))
    with pytest.raises(CorruptArtefactError, match="once/job-a"):
        store.publish("rover", files_of("again"), draft_of("again"), once_key="job-a")
    assert sorted(path.name for path in (directory / "models/rover/versions").rglob("*")) == before


def test_manifests_from_before_jobs_are_read(store, files, draft):
    store.publish("viper", files, draft)
    assert store.manifest("viper", 1).lineage.job is None
