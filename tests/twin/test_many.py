"""Many scenarios in columns: the same as one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from service.errors import InvalidValueError
from service.twin import ManyScenarios, Scenario

SCENARIOS = [Scenario(20, 430, 60, 4), Scenario(-3.5, 900, 0, 0.1), Scenario(0, 1, 300, 600)]


def test_what_is_put_in_comes_out():
    many = ManyScenarios.of(SCENARIOS)

    assert list(many) == SCENARIOS
    assert many[-1] == SCENARIOS[-1]
    assert list(many[1:]) == SCENARIOS[1:]
    assert list(many.only(np.array([2, 0]))) == [SCENARIOS[2], SCENARIOS[0]]
    assert ManyScenarios.of(many) is many
    assert len(ManyScenarios.of([])) == 0


def test_physics_are_those_of_each():
    physics = ManyScenarios.of(SCENARIOS).as_physics()

    for name in ("slope_angle_rad", "mass_kg", "torque_nm"):
        one = [getattr(each.as_physics(), name)[0] for each in SCENARIOS]
        assert getattr(physics, name).tolist() == one


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -1.0, 90.0, 0.0, 1e-7])
@pytest.mark.parametrize("field", ["slope_deg", "mass_kg", "torque_nm", "horizon_s"])
def test_what_no_scenario_may_be_is_refused_in_its_words(field, value):
    columns = {"slope_deg": 20.0, "mass_kg": 430.0, "torque_nm": 60.0, "horizon_s": 4.0}

    wanted = columns | {field: value}
    many = {name: np.array([columns[name], each]) for name, each in wanted.items()}

    assert refusal(lambda: ManyScenarios(**many)) == refusal(lambda: Scenario(**wanted))


def refusal(make):
    try:
        make()
    except InvalidValueError as error:
        return str(error)
    return None
