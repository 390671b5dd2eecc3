"""Kill publishers of one key at any moment, two at a time, until one gets through: each key ends as one whole version.

Run as a program this file is the nursery of `test_publish_kill`: it forks two rival publishers per line on stdin.
"""

from __future__ import annotations

import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from model_store import Lineage, ManifestDraft, ModelStore

pytestmark = pytest.mark.kills

LIVES = 50
RIVALS = 2
LONGEST_DELAY_S = 0.05
WEIGHTS_BYTES = 2_000_000


def acknowledge(*words):
    os.write(1, (" ".join(map(str, words)) + "\n").encode())


def files_of(tag):
    return {"weights.safetensors": tag.encode().ljust(WEIGHTS_BYTES, b"."), "report/tag.txt": tag.encode()}


def publish(store, number, tag):
    key = f"job-{number}"
    draft = ManifestDraft(created_by=tag, checkpoint={}, domain={}, metrics={}, lineage=Lineage(job=key))
    return store.publish("rover", files_of(tag), draft, once_key=key)


def nursery(url):
    for life, line in enumerate(sys.stdin):
        writers = []
        for rival in range(RIVALS):
            writer = os.fork()
            if writer == 0:
                store = ModelStore.open(url)
                store.model_names()
                acknowledge("alive", os.getpid())
                # the job that was not acknowledged is attempted again, then the next ones
                for number in itertools.count(int(line)):
                    acknowledge("ack", number, publish(store, number, f"{life}-{rival}").version)
            writers.append(writer)
        for writer in writers:
            os.waitpid(writer, 0)
        acknowledge("dead", life)


class Rivals:
    """Starts two publishers, kills both after seeded random delays, and notes what they acknowledged."""

    def __init__(self, url):
        self.nursery = subprocess.Popen(
            [sys.executable, __file__, str(url)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        )
        self.acknowledged: dict[int, set[int]] = {}
        self.attempts = 0

    def run(self):
        delays = random.Random(20261122)
        try:
            for _ in range(LIVES):
                self._one_life(sorted(delays.uniform(0, LONGEST_DELAY_S) for _ in range(RIVALS)))
        finally:
            self.nursery.kill()
            self.nursery.wait()
            self.nursery.stdin.close()
            self.nursery.stdout.close()

    def _one_life(self, delays):
        self.nursery.stdin.write(f"{max(self.acknowledged, default=-1) + 1}\n")
        self.nursery.stdin.flush()
        alive = []
        while len(alive) < RIVALS:
            word, *values = self.nursery.stdout.readline().split()
            if word == "alive":
                alive.append(int(values[0]))
            else:
                self._note(word, values)
        waited = 0.0
        for pid, delay in zip(alive, delays, strict=True):
            time.sleep(delay - waited)
            waited = delay
            os.kill(pid, signal.SIGKILL)
        for line in self.nursery.stdout:
            word, *values = line.split()
            if word == "dead":
                return
            self._note(word, values)
        pytest.fail("the nursery died")

    def _note(self, word, values):
        assert word == "ack"
        number, version = map(int, values)
        self.acknowledged.setdefault(number, set()).add(version)


def versions_by_job(store):
    """Which versions each job has; every version is verified and is of one publisher only."""
    found: dict[str, list[int]] = {}
    for version in store.versions("rover"):
        manifest = store.verify("rover", version)
        for file, content in files_of(manifest.created_by).items():
            assert store.read_file(manifest, file) == content
        found.setdefault(manifest.lineage.job, []).append(version)
    return found


@pytest.fixture
def place(tmp_path):
    yield tmp_path
    shutil.rmtree(tmp_path)  # hundreds of megabytes, of no use once the test has looked


@pytest.mark.skipif(not hasattr(os, "fork"), reason="SIGKILL and fork are POSIX")
def test_rivals_killed_at_any_moment_publish_each_job_once(place):
    rivals = Rivals(place)
    rivals.run()
    store = ModelStore.open(place)
    before = versions_by_job(store)
    assert all(len(versions) == 1 for versions in before.values()), "a job was published twice"
    assert rivals.acknowledged, "no publisher ever lived long enough"
    for number, versions in rivals.acknowledged.items():
        assert versions == set(before[f"job-{number}"]), "an acknowledged version is lost, or there were two"

    begun = {int(folder.name) for folder in (place / "models/rover/versions").iterdir()}
    assert len(begun) - len(store.versions("rover")) > LIVES / 10, "hardly a kill fell into a publication"
    for number in range(max(rivals.acknowledged) + 2):
        publish(store, number, "after")
    after = versions_by_job(store)
    assert sorted(after) == sorted(f"job-{number}" for number in range(max(rivals.acknowledged) + 2))
    assert all(len(versions) == 1 for versions in after.values())
    assert before.items() <= after.items()


if __name__ == "__main__":
    nursery(*sys.argv[1:])
