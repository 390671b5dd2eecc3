from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given

from service.learning.network.inputs import INPUT_NAMES, InputSignature
from service.learning.observed import scenarios_of
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios
from tests.learning.synthetic import HORIZON_S, synthetic_runs
from tests.physics.strategies import scenario

RUNS = scenarios_of(synthetic_runs())


def fitted(*names: str) -> InputSignature:
    return InputSignature.fitted(names, RUNS, HORIZON_S, VIPER, LUNAR_REGOLITH)


def test_training_runs_span_minus_one_to_one():
    columns = fitted(*INPUT_NAMES).scenario_columns(RUNS)
    np.testing.assert_allclose(columns.min(axis=0), -1, atol=1e-6)
    np.testing.assert_allclose(columns.max(axis=0), 1, atol=1e-6)


def test_the_horizon_spans_minus_one_to_one():
    assert fitted("time_s").time_column(np.array([0.0, HORIZON_S / 2, HORIZON_S])).tolist() == [-1, 0, 1]


def test_an_input_that_never_varies_maps_to_zero():
    signature = InputSignature.fitted(("time_s", "mass_kg"), Scenarios.of(1, 430, 60), 10, VIPER, LUNAR_REGOLITH)
    assert signature.scenario_columns(Scenarios.of(5, 430, 99)).tolist() == [[0.0]]


@given(scenario)
def test_torque_ratio_does_not_see_mass_and_torque_doubled_together(one):
    double = Scenarios(one.slope_angle_rad, 2 * one.mass_kg, 2 * one.torque_nm)
    signature = fitted("time_s", "torque_ratio")
    np.testing.assert_allclose(signature.scenario_columns(double), signature.scenario_columns(one), rtol=1e-6)


def test_survives_json():
    signature = fitted(*INPUT_NAMES)
    assert InputSignature.restore(json.loads(json.dumps(signature.describe())), VIPER, LUNAR_REGOLITH) == signature


@pytest.mark.parametrize("names", [("slope_deg", "time_s", "slope_deg"), ("time_s", "time_s")])
def test_inputs_do_not_repeat(names):
    with pytest.raises(ValueError, match="input"):
        fitted(*names)


def test_an_unknown_input_is_refused_by_name():
    with pytest.raises(ValueError, match="'colour', allowed is one of time_s, slope_deg"):
        fitted("time_s", "colour")
