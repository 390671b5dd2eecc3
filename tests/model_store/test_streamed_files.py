"""A dataset's file piece by piece: whole and as published, or never whole."""

from __future__ import annotations

import hashlib

import pytest

from model_store import CorruptArtefactError, DatasetDraft, DatasetNotFoundError, ModelStore, NotFoundError

DATA = bytes(range(256)) * 12_000  # three pieces
ID = hashlib.sha256(DATA).hexdigest()


@pytest.fixture
def kept(tmp_path):
    store = ModelStore.open(tmp_path, create=True)
    store.put_dataset(ID, {"runs.parquet": DATA, "empty": b""}, DatasetDraft(name="a", created_by="tests"))
    return store


def test_the_pieces_are_the_file(kept):
    entry, pieces = kept.stream_dataset_file(ID, "runs.parquet")
    arrived = list(pieces)

    assert b"".join(arrived) == DATA
    assert (entry.size_bytes, entry.sha256) == (len(DATA), ID)
    assert max(map(len, arrived)) < len(DATA) / 2
    assert b"".join(kept.stream_dataset_file(ID, "empty")[1]) == b""


@pytest.mark.parametrize(
    "damaged",
    [DATA[:-1] + b"x", b"x" + DATA[1:], DATA[:-1], DATA + b"x", DATA + DATA, b"", DATA[: 1 << 20]],
    ids=["last byte", "first byte", "shorter", "longer", "twice", "empty", "one piece"],
)
def test_a_file_that_is_not_the_published_one_never_arrives_whole(kept, tmp_path, damaged):
    (tmp_path / "datasets" / ID / "runs.parquet").write_bytes(damaged)
    arrived = []
    _, pieces = kept.stream_dataset_file(ID, "runs.parquet")

    with pytest.raises(CorruptArtefactError, match="published"):
        arrived.extend(pieces)

    assert sum(map(len, arrived)) < len(DATA)


def test_what_is_not_there(kept, tmp_path):
    with pytest.raises(NotFoundError, match=r"runs\.parquet"):
        kept.stream_dataset_file(ID, "no-such")
    with pytest.raises(DatasetNotFoundError):
        kept.stream_dataset_file("0" * 64, "runs.parquet")
    (tmp_path / "datasets" / ID / "runs.parquet").unlink()
    with pytest.raises(CorruptArtefactError, match="gone"):
        next(kept.stream_dataset_file(ID, "runs.parquet")[1])
