"""What leaving out promises, on the paper's thirteen slopes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import model_store
from model_store import ModelStore
from service.learning.drive.fit import fit_drive
from service.training.data import load_training_data
from tests.learning.drive.fitted import PRIOR


@pytest.fixture(scope="module")
def paper(slow):
    """The paper's thirteen slopes, one sample each 5 ms, and their fit."""
    runs = load_training_data(ModelStore.open(Path(model_store.__file__).parent), ["paper"]).runs
    runs = [run.samples(slice(None, None, 10)) for run in runs]
    return runs, fit_drive(runs, PRIOR)


def test_a_slope_is_predicted_without_its_run(paper):
    runs, fitted = paper
    for run in runs:
        if 20 < run.slope_deg <= 28:  # steeper ones hang on a single neighbour
            assert abs(fitted.left_out[run.name].x_m[0, -1] - run.x_m[-1]) < 0.05, run.name
            assert abs(fitted.left_out[run.name].y_m[0, -1] - run.y_m[-1]) < 0.004, run.name


def test_leaving_out_is_nearly_fitting_without(paper):
    runs, fitted = paper
    (run,) = [run for run in runs if run.slope_deg == 25]
    without = fit_drive([other for other in runs if other is not run], PRIOR).model.drive_run(run)
    np.testing.assert_allclose(fitted.left_out[run.name].x_m, without.x_m, atol=0.01)
