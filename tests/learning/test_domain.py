from __future__ import annotations

import json

import pytest

from service.learning.domain import Domain
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from tests.learning.synthetic import HORIZON_S, synthetic_runs

DOMAIN = Domain.of_runs(synthetic_runs(), VIPER, LUNAR_REGOLITH)


def test_every_training_run_is_inside():
    for run in synthetic_runs():
        verdict = DOMAIN.judge(run.slope_deg, run.mass_kg, run.torque_nm, run.horizon_s)
        assert verdict.inside
        assert verdict.reasons == ()


@pytest.mark.parametrize(
    ("scenario", "fields"),
    [
        ((21, 430, 60, 4), ["slope_deg"]),
        ((-1, 430, 60, 4), ["slope_deg"]),
        ((10, 950, 60, 4), ["mass_kg", "torque_ratio"]),
        ((10, 430, 60, 4.5), ["horizon_s"]),
        ((10, 430, 130, 4), ["torque_nm", "torque_ratio"]),
        # mass and torque are each inside, but no run had so much torque for so little mass
        ((10, 300, 120, 4), ["torque_ratio"]),
    ],
)
def test_what_is_outside_is_named(scenario, fields):
    verdict = DOMAIN.judge(*scenario)
    assert not verdict.inside
    assert [reason.field for reason in verdict.reasons] == fields


def test_a_reason_says_how_far():
    (reason,) = DOMAIN.judge(21.5, 430, 60, HORIZON_S).reasons
    assert reason.detail == "slope_deg 21.5 deg is 1.5 deg above the training runs (0 to 20 deg)"


def test_survives_json():
    restored = Domain.restore(json.loads(json.dumps(DOMAIN.describe())), VIPER, LUNAR_REGOLITH)
    assert restored.describe() == DOMAIN.describe()


@pytest.mark.parametrize("description", [{}, {"slope_deg": [1]}, {**DOMAIN.describe(), "mass_kg": [5, 1]}])
def test_a_description_that_does_not_fit_is_refused(description):
    with pytest.raises((KeyError, IndexError, ValueError)):
        Domain.restore(description, VIPER, LUNAR_REGOLITH)
