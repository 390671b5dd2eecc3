from __future__ import annotations

import math
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.errors import InvalidValueError
from service.twin import Scenario, sample_times
from service.twin.scenario import sample_count

steps = st.floats(1e-4, 60)
horizons = st.floats(1e-3, 600)


@given(horizons, steps)
def test_times_start_at_zero_rise_and_end_at_the_horizon(horizon_s, dt_s):
    if horizon_s / dt_s > 1e5:
        dt_s = horizon_s / 1e5
    times = sample_times(horizon_s, dt_s)
    assert times[0] == 0
    assert times[-1] == horizon_s
    assert (np.diff(times) > 0).all()
    assert len(times) == sample_count(horizon_s, dt_s)
    if len(times) > 2:
        np.testing.assert_allclose(np.diff(times[:-1]), dt_s, rtol=1e-6)


@pytest.mark.parametrize(
    ("horizon_s", "dt_s", "count"), [(10, 0.05, 201), (10, 0.0005, 20_001), (0.3, 0.1, 4), (1, 0.3, 5), (1, 5, 2)]
)
def test_how_many_times(horizon_s, dt_s, count):
    assert len(sample_times(horizon_s, dt_s)) == sample_count(horizon_s, dt_s) == count


@given(st.integers(1, 20_000), st.sampled_from(["0.05", "0.0005", "0.3", "0.1", "0.007", "2.5"]))
def test_multiples_of_a_decimal_step_are_decimals(steps, step):
    exact = [float(row * Decimal(step)) for row in range(steps + 1)]
    assert sample_times(exact[-1], float(step)).tolist() == exact


@pytest.mark.parametrize(("horizon_s", "dt_s"), [(0, 1), (1, 0), (1, -1), (math.inf, 1), (1, math.nan)])
def test_impossible_samplings_are_refused(horizon_s, dt_s):
    with pytest.raises(InvalidValueError, match="positive and finite"):
        sample_times(horizon_s, dt_s)


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ((90, 430, 60, 10), "slope_deg"),
        ((math.nan, 430, 60, 10), "slope_deg"),
        ((20, 0, 60, 10), "mass_kg"),
        ((20, 430, -1, 10), "torque_nm"),
        ((20, 430, 60, 0), "horizon_s"),
        ((20, 430, 60, math.inf), "horizon_s"),
    ],
)
def test_impossible_scenarios_name_the_field(values, field):
    with pytest.raises(InvalidValueError, match=field):
        Scenario(*values)


def test_a_rover_without_torque_is_a_scenario():
    assert Scenario(20, 430, 0, 10).as_physics().torque_nm.tolist() == [0.0]
