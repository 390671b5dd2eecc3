from __future__ import annotations

import numpy as np
import pytest

from service.datasets.run import Dataset, Run
from service.errors import InvalidValueError


def run(columns, **scenario):
    values = {"slope_deg": 20.0, "mass_kg": 430.0, "torque_nm": 60.0, "horizon_s": 10.0} | scenario
    return Run("r", "paper", **values, columns=columns)


def test_columns_stand_in_canonical_order_and_cannot_be_changed(make_motion):
    made = make_motion()
    one = run(dict(reversed(made.items())))
    assert list(one.columns) == list(made)
    with pytest.raises(ValueError, match="read-only"):
        one.x_m[0] = 1.0
    made["rear_x_m"][0] = 0.0  # the caller's own array stays the caller's


@pytest.mark.parametrize(
    "change",
    [
        {"rear_y_m": None},
        {"colour": np.zeros(201)},
        {"rear_x_m": np.zeros(200)},
        {"rear_x_m": np.zeros((201, 1))},
        {"rear_x_m": np.full(201, np.nan)},
        {"time_s": np.zeros(201)},
    ],
)
def test_nonsense_is_refused_when_made(make_motion, change):
    columns = {name: column for name, column in (make_motion() | change).items() if column is not None}
    with pytest.raises(InvalidValueError, match="of run r"):
        run(columns)


def test_a_scenario_is_finite(make_motion):
    with pytest.raises(InvalidValueError, match="scenario of run r"):
        run(make_motion(), mass_kg=np.inf)


def test_a_dataset_has_runs_with_unique_names(make_motion):
    one = run(make_motion())
    for runs in ((), (one, one)):
        with pytest.raises(InvalidValueError):
            Dataset("d", None, runs)
