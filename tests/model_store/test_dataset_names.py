"""A dataset that was put again under other names is stored once, and every one of its names finds it."""

from __future__ import annotations

import pytest

from model_store import (
    ConflictError,
    DatasetDraft,
    DatasetNameTakenError,
    DatasetNotFoundError,
    InvalidDraftError,
    InvalidReferenceError,
    NotFoundError,
    stored_datasets,
)

ID, OTHER = "ab" * 32, "cd" * 32


@pytest.fixture
def named(store):
    store.put_dataset(ID, {"x": b"x"}, DatasetDraft(name="first", created_by="me"))
    assert store.name_dataset(ID, "second", created_by="you")
    return store


def test_each_name_finds_it_and_the_first_one_is_that_of_the_record(named):
    record = named.dataset(ID)
    assert named.dataset("first") == named.dataset("second") == record
    assert named.dataset_names(record) == ["first", "second"]
    assert named.other_dataset_names() == {ID: ["second"]}
    assert named.dataset_ids() == [ID]


def test_a_name_is_given_once(named):
    assert not named.name_dataset(ID, "second", created_by="you")
    assert not named.name_dataset(ID, "first", created_by="you")
    assert named.dataset_names(named.dataset(ID)) == ["first", "second"]


def test_names_go_with_the_dataset(named, directory):
    named.delete_dataset(ID)
    for name in ("first", "second"):
        with pytest.raises(DatasetNotFoundError):
            named.dataset(name)
    assert not [path for path in directory.rglob("*") if path.is_file()]


def test_a_name_of_two_datasets_is_ambiguous(named):
    named.put_dataset(OTHER, {"x": b"y"}, DatasetDraft(name="second", created_by="me"))
    with pytest.raises(InvalidReferenceError, match="ambiguous"):
        named.dataset("second")
    assert named.dataset("first").id == ID


def test_a_name_that_finds_another_one_is_taken(named):
    for name in ("first", "second", ID[:6]):
        with pytest.raises(DatasetNameTakenError, match=ID):
            named.require_dataset_name(OTHER, name)
        named.require_dataset_name(ID, name)
    named.require_dataset_name(OTHER, "free")


def test_an_ambiguous_name_can_be_taken_away_again_but_for_the_first(named):
    named.put_dataset(OTHER, {"x": b"y"}, DatasetDraft(name="second", created_by="me"))
    with pytest.raises(DatasetNameTakenError, match="ambiguous"):
        named.require_dataset_name("ef" * 32, "second")

    named.forget_dataset_name(ID, "second")

    assert named.dataset("second").id == OTHER
    assert named.dataset_names(named.dataset(ID)) == ["first"]
    with pytest.raises(NotFoundError):
        named.forget_dataset_name(ID, "second")
    with pytest.raises(ConflictError):
        named.forget_dataset_name(ID, "first")
    with pytest.raises(DatasetNotFoundError):
        named.forget_dataset_name("ef" * 32, "first")


def test_what_is_no_name_or_no_dataset_is_refused(named, monkeypatch):
    for name in ("", "../x", "a/b", "x" * 64):
        with pytest.raises(InvalidReferenceError):
            named.name_dataset(ID, name, created_by="me")
    with pytest.raises(InvalidDraftError):
        named.name_dataset(ID, "third", created_by="")
    with pytest.raises(DatasetNotFoundError):
        named.name_dataset(OTHER, "third", created_by="me")
    monkeypatch.setattr(stored_datasets, "MOST_NAMES", 2)
    with pytest.raises(ConflictError):
        named.name_dataset(ID, "third", created_by="me")
    assert named.dataset_names(named.dataset(ID)) == ["first", "second"]
