from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import TrainingError
from service.learning.split import split_runs, training_samples, validation_samples
from tests.learning.synthetic import synthetic_run, synthetic_runs

RUNS = synthetic_runs()


@given(st.floats(0, 0.9), st.integers(0, 1000))
def test_every_run_is_on_one_side(fraction, seed):
    split = split_runs(RUNS, test_fraction=fraction, seed=seed)
    assert sorted(run.name for run in split.train + split.test) == sorted(run.name for run in RUNS)
    assert len(split.test) == round(fraction * len(RUNS))


@given(st.integers(0, 1000))
def test_a_slope_left_out_is_never_trained_on(seed):
    split = split_runs(RUNS, test_slopes_deg=[12, 5], test_fraction=0.3, seed=seed)
    assert not {12.0, 5.0} & {run.slope_deg for run in split.train}


def test_the_seed_decides():
    first, again = (split_runs(RUNS, test_fraction=0.5, seed=4) for _ in range(2))
    assert first == again
    assert any(split_runs(RUNS, test_fraction=0.5, seed=seed).test != first.test for seed in range(5, 10))


def test_a_slope_that_no_run_has_is_refused():
    with pytest.raises(TrainingError, match="no run has slope_deg 28"):
        split_runs(RUNS, test_slopes_deg=[28])


def test_leaving_out_everything_is_refused():
    with pytest.raises(TrainingError, match="nothing remains"):
        split_runs([synthetic_run(5)], test_slopes_deg=[5])


@pytest.mark.parametrize("samples", [4, 5, 80, 81])
def test_three_of_four_samples_train_and_the_fourth_validates(samples):
    run = synthetic_run(5, samples=samples)
    train, validation = training_samples(run), validation_samples(synthetic_run(5, samples=max(samples, 8)))
    assert len(train.time_s) == samples - samples // 4
    np.testing.assert_array_equal(train.time_s[:4], run.time_s[[0, 1, 2, 4]] if samples > 4 else train.time_s[:4])
    assert validation.time_s[0] == synthetic_run(5, samples=max(samples, 8)).time_s[3]
