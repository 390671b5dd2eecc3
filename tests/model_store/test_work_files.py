"""Work files of jobs: replaced, verified, and gone when the job is."""

from __future__ import annotations

import pytest

from model_store import CorruptArtefactError, InvalidReferenceError, ModelStore

JOB = "6f1b9a52-7c0e-4d61-9a53-2f0c9be6a7d4"
OTHER = "00000000-7c0e-4d61-9a53-2f0c9be6a7d4"


@pytest.fixture
def store(tmp_path):
    return ModelStore.open(tmp_path / "store", create=True)


def test_the_last_bytes_put_are_read(store):
    store.put_work(JOB, "state", b"one")
    kept = store.put_work(JOB, "state", b"two")
    assert store.read_work(JOB, "state", kept) == b"two"
    assert store.work_names(JOB) == ["state"]
    assert store.jobs_with_work() == [JOB]


def test_other_bytes_than_those_put_are_refused(store):
    kept = store.put_work(JOB, "state", b"one")
    for data in (b"two", b"on", b"ones"):
        store.put_work(JOB, "state", data)
        with pytest.raises(CorruptArtefactError):
            store.read_work(JOB, "state", kept)
    store.remove_work(JOB, "state")
    with pytest.raises(CorruptArtefactError):
        store.read_work(JOB, "state", kept)


def test_removing_takes_one_job_and_may_be_repeated(store):
    for name in ("a", "b"):
        store.put_work(JOB, name, b"x")
        store.put_work(OTHER, name, b"x")
    store.remove_work(JOB, "a")
    store.remove_work(JOB, "a")
    assert store.work_names(JOB) == ["b"]
    store.remove_work(JOB)
    store.remove_work(JOB)
    assert store.jobs_with_work() == [OTHER]


@pytest.mark.parametrize(("job", "file"), [("..", "x"), (JOB.upper(), "x"), (JOB, "../x"), (JOB, ""), (JOB, "a/b")])
def test_no_name_leads_out_of_the_jobs_folder(store, job, file):
    with pytest.raises(InvalidReferenceError):
        store.put_work(job, file, b"x")


def test_what_else_lies_beside_is_no_job(store, tmp_path):
    (tmp_path / "store" / "jobs" / "jobs.sqlite.workers").mkdir(parents=True)
    (tmp_path / "store" / "jobs" / "jobs.sqlite").touch()
    assert store.jobs_with_work() == []
