"""A copy has everything, can be read at any moment, and overwrites nothing."""

from __future__ import annotations

from itertools import count

import pytest

from model_store import DatasetDraft, Lineage, ManifestDraft, ModelStore, StoreUnavailableError
from model_store.backend import Backend
from model_store.copying import copy

IDENTITY = "a" * 64


class Breaking:
    """A target that fails at its n-th write."""

    def __init__(self, backend: Backend, number: int) -> None:
        self._backend, self._number, self._writes = backend, number, count()

    def create(self, key: str, data: bytes) -> bool:
        if next(self._writes) == self._number:
            raise StoreUnavailableError("broken off")
        return self._backend.create(key, data)

    def __getattr__(self, name: str):
        return getattr(self._backend, name)


def publish(store: ModelStore, tag: str) -> int:
    draft = ManifestDraft(created_by="tests", checkpoint={}, domain={}, metrics={}, lineage=Lineage())
    files = {"weights.safetensors": tag.encode(), "report/a.txt": tag.encode()}
    return store.publish("rover", files, draft, once_key=tag).version


@pytest.fixture
def store(tmp_path) -> ModelStore:
    store = ModelStore.open(tmp_path / "source", create=True)
    for tag in ("one", "two"):
        version = publish(store, tag)
        store.move_alias("rover", "champion", version, actor="tests", reason=tag)
    store.put_dataset(IDENTITY, {"runs": b"1"}, DatasetDraft(name="runs", created_by="tests", summary={}))
    store.put_work("6f1b9a52-7c0e-4d61-9a53-2f0c9be6a7d4", "fit.safetensors", b"2")
    return store


def require_whole(store: ModelStore) -> None:
    """Whatever can be seen can be read, and whatever is named is there."""
    for name in store.model_names():
        versions = store.versions(name)
        for version in versions:
            store.verify(name, version)
        for alias in store.aliases(name):
            assert {record.version for record in store.alias_history(name, alias)} <= set(versions)
    for identity in store.dataset_ids():
        store.read_dataset_file(identity, "runs")


def test_a_copy_has_everything_but_work_and_copying_again_does_nothing(store, tmp_path):
    other = ModelStore.open(tmp_path / "target", create=True)
    copied, present = store.copy_to(other)
    assert present == 0
    require_whole(other)
    assert other.versions("rover") == [1, 2]
    assert other.alias_history("rover", "champion") == store.alias_history("rover", "champion")
    assert other.dataset("runs") == store.dataset("runs")
    assert other.published_once("rover", "two") == store.published_once("rover", "two")
    assert other.jobs_with_work() == []
    assert store.copy_to(other) == (0, copied)


def test_a_copy_that_is_broken_off_anywhere_is_whole_and_goes_on(store, tmp_path):
    for number in count():
        folder = tmp_path / f"target-{number}"
        target = Backend.open(folder, create=True)
        try:
            copied, _ = copy(store._backend, Breaking(target, number))
        except StoreUnavailableError:
            require_whole(ModelStore.open(folder))
            store.copy_to(ModelStore.open(folder))
            require_whole(ModelStore.open(folder))
            assert ModelStore.open(folder).versions("rover") == [1, 2]
        else:
            assert copied == number
            return


def test_what_the_target_has_stays(store, tmp_path):
    other = ModelStore.open(tmp_path / "target", create=True)
    publish(other, "mine")
    store.copy_to(other)
    assert other.read_file(other.manifest("rover", 1), "weights.safetensors") == b"mine"


def test_what_is_published_meanwhile_is_whole_or_not_there(store, tmp_path):
    """The source changes after each of the listings that a copy is made of."""
    other = ModelStore.open(tmp_path / "target", create=True)
    tags = count()

    class Changing(Breaking):
        def keys(self, prefix: str) -> list[str]:
            found = self._backend.keys(prefix)
            version = publish(store, f"new-{next(tags)}")
            store.move_alias("rover", "champion", version, actor="tests", reason="meanwhile")
            return found

    copy(Changing(store._backend, -1), other._backend)
    require_whole(other)
