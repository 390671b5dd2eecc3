"""Steps of a job called one by one, as a worker may after a kill: what runs again gives the same."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from service.jobs import workflow
from service.jobs.request import Budget, TrainingJobRequest
from service.learning.checkpoint import weights_bytes

REQUEST = TrainingJobRequest(
    model="steps", datasets=("unit",), architecture="paper_network", budget=Budget(max_epochs=4)
)
JOB = "00000000-0000-4000-8000-000000000000"
START = {"finished": False, "seconds": 0.0, "epoch": 0, "file": None}


class SilentAttempt:
    """An attempt that nobody listens to and nobody ends."""

    def __init__(self, _runner, _job_id):
        self.told = []

    def tell(self, message):
        self.told.append(message)

    def show(self, _phase, _part):
        pass

    def show_epoch(self, _reached):
        pass

    def look(self, **_how):
        pass


@pytest.fixture
def attempt(store, monkeypatch):
    """Makes attempts at one and the same job, whose chunks are one epoch long."""
    monkeypatch.setattr(workflow, "CHUNK_S", 0.0)
    monkeypatch.setattr(workflow, "Attempt", SilentAttempt)
    runner = SimpleNamespace(store=store, is_ending=lambda: False)
    return lambda: workflow._Job(runner, JOB, REQUEST, "tester")


def place(done):
    return {name: value for name, value in done.items() if name != "seconds"}


def damage(store, done):
    store.put_work(JOB, done["file"], b"something else")


@pytest.mark.slow
def test_a_chunk_that_runs_again_leaves_the_same_bytes_wherever_it_runs(attempt):
    first = attempt()
    one = first._fit_chunk(START)
    two = first._fit_chunk(one)
    again = first._fit_chunk(one)
    elsewhere = attempt()._fit_chunk(one)
    assert (one["epoch"], two["epoch"]) == (1, 2)
    assert place(two) == place(again) == place(elsewhere)


@pytest.mark.slow
def test_chunks_end_with_the_last_epoch(attempt):
    job = attempt()
    done, epochs = START, []
    while not done["finished"]:
        done = job._fit_chunk(done)
        epochs.append(done["epoch"])
    assert epochs == [1, 2, 3, 4]


def test_a_chunk_whose_state_is_damaged_starts_again_and_comes_to_the_same(attempt, store):
    first, second = attempt(), attempt()
    one = first._fit_chunk(START)
    two = first._fit_chunk(one)
    damage(store, two)
    anew = second._fit_chunk(two)
    assert any("cannot be used" in message for message in second._attempt.told)
    assert place(anew) == place(one)
    assert place(second._fit_chunk(anew)) == place(two)


def test_a_finished_fit_whose_state_is_damaged_is_fitted_to_the_same_epoch_again(attempt, store):
    first, second = attempt(), attempt()
    up = first._fit_chunk(first._fit_chunk(START)) | {"finished": True}  # its time is up
    damage(store, up)
    assert second._evaluate(up) == first._evaluate(up)
    one, other = first._complete(up), second._complete(up)
    assert weights_bytes(one.model) == weights_bytes(other.model)
    assert one.outcome == other.outcome
    assert (one.outcome.epochs, one.outcome.stopped_early) == (2, True)
