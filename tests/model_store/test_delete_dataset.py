"""Deleting datasets: gone at once, gone whole, and never under somebody who puts it anew."""

from __future__ import annotations

import threading

import pytest

from model_store import DatasetDraft, DatasetNotFoundError, Lineage, ModelStore
from model_store.backend import Backend

ID = "ab" * 32
FILES = {"runs.parquet": b"runs" * 1000, "passport.json": b"{}"}
DRAFT = DatasetDraft(name="set", created_by="tests")


def test_a_deleted_dataset_is_gone_and_can_be_put_anew(store, directory):
    store.put_dataset(ID, FILES, DRAFT)
    store.delete_dataset(ID)
    assert store.dataset_ids() == []
    assert not [each for each in (directory / "datasets").rglob("*") if each.is_file()]
    with pytest.raises(DatasetNotFoundError):
        store.delete_dataset(ID)
    other = {**FILES, "runs.parquet": b"others"}
    assert store.offer_dataset(ID, other, DRAFT)[1]
    assert store.read_dataset_file(ID, "runs.parquet") == b"others"


def test_what_a_killed_deletion_left_is_removed_by_the_next(store, directory):
    store.put_dataset(ID, FILES, DRAFT)
    (directory / "datasets" / ID / "dataset.json").unlink()
    store.delete_dataset(ID)
    assert not [each for each in (directory / "datasets").rglob("*") if each.is_file()]


def test_only_the_first_offer_is_told_that_it_published(store):
    first, created = store.offer_dataset(ID, FILES, DRAFT)
    assert created
    assert store.offer_dataset(ID, FILES, DatasetDraft(name="other", created_by="x")) == (first, False)


def test_datasets_in_use_names_every_version(store, draft, files):
    assert store.datasets_in_use() == {}
    lineage = Lineage(datasets=[ID, "cd" * 32])
    store.publish("one", files, draft.model_copy(update={"lineage": lineage}))
    store.publish("one", files, draft.model_copy(update={"lineage": Lineage(datasets=[ID])}))
    store.publish("two", files, draft.model_copy(update={"lineage": Lineage()}))
    assert store.datasets_in_use() == {ID: ["one@1", "one@2"], "cd" * 32: ["one@1"]}


def test_a_broken_manifest_does_not_hide_the_others(store, draft, files, directory):
    for _ in range(2):
        store.publish("one", files, draft)
    (directory / "models" / "one" / "versions" / "1" / "manifest.json").write_text("{")
    assert store.datasets_in_use() == {ID: ["one@2"]}


class _Interrupted(Backend):
    """A backend on which somebody puts the dataset anew before the nth removal."""

    def __init__(self, inner, nth, put):
        super().__init__(inner._objects, inner.location)
        self._left, self._put = nth, put

    def remove(self, key):
        super().remove(key)
        self._left -= 1
        if self._left == 0:
            self._put()


@pytest.mark.parametrize("nth", [1, 2, 3])
def test_a_put_in_the_middle_of_a_deletion_survives_it_whole(nth, store, directory):
    store.put_dataset(ID, FILES, DRAFT)
    backend = _Interrupted(Backend.open(str(directory)), nth, lambda: store.put_dataset(ID, FILES, DRAFT))
    ModelStore(backend).delete_dataset(ID)
    assert store.dataset(ID).name == "set"
    assert {file: store.read_dataset_file(ID, file) for file in FILES} == FILES


def test_many_puts_and_deletions_at_once_leave_a_whole_dataset_or_none(directory):
    store = ModelStore.open(str(directory), create=True)

    def churn(act):
        for _ in range(40):
            act()

    def delete():
        try:
            store.delete_dataset(ID)
        except DatasetNotFoundError:
            return

    threads = [
        threading.Thread(target=churn, args=(act,)) for act in (delete, lambda: store.put_dataset(ID, FILES, DRAFT))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    store.put_dataset(ID, FILES, DRAFT)
    assert {file: store.read_dataset_file(ID, file) for file in FILES} == FILES
