"""A fit without epochs can be stopped all the way through: what it calls every second or so may raise."""

from __future__ import annotations

from typing import get_args

import pytest

from model_store import ModelStore
from service.training import architectures
from service.training.architectures import begin_fit
from service.training.config import FEWEST_RUNS, ArchitectureName, TrainingConfig
from service.training.train import evaluate_fitted, prepare
from tests.training.stored import put_dataset, stored_runs

CONFIG = TrainingConfig(model="unit", datasets=["few"], architecture="drive_model")


class StoppedError(Exception):
    """What the check of these tests raises."""


def fit(store, check):
    prepared = prepare(store, CONFIG, lambda _phase: None)
    fitted = begin_fit(prepared, check=check).finish()
    return evaluate_fitted(prepared, fitted, lambda _phase: None, check)


@pytest.fixture(scope="module")
def store(tmp_path_factory, slow):
    """Few runs: they are fitted several times."""
    store = ModelStore.open(tmp_path_factory.mktemp("architectures") / "store", create=True)
    put_dataset(store, "few", stored_runs()[1:4])
    return store


@pytest.fixture(scope="module")
def calls(store):
    count = 0

    def check():
        nonlocal count
        count += 1

    fit(store, check)
    return count


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.7, 0.99])
def test_a_check_that_raises_stops_the_fit_there(store, calls, share):
    left = at = int(share * calls)

    def check():
        nonlocal left
        left -= 1
        if left < 0:
            raise StoppedError

    with pytest.raises(StoppedError):
        fit(store, check)
    assert left == -1, f"it went on after check {at} of {calls}"


def test_there_are_checks_for_each_run_in_every_part(store, calls):
    # the steps of the fit, the left-out predictions, the evaluation
    assert calls >= 10 + 2 * store.dataset("few").summary["runs"]


def test_every_architecture_can_be_fitted_and_says_how_many_runs_it_needs():
    names = set(get_args(ArchitectureName))
    assert names == set(FEWEST_RUNS) == set(architectures._BEGIN)
