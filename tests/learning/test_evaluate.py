from __future__ import annotations

import numpy as np
import pytest

from service.learning.evaluate import PositionErrors, evaluate, summarise
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import make_residual
from service.learning.observed import ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from service.physics.scenario import Positions, Scenarios
from tests.learning.synthetic import HORIZON_S, synthetic_runs


def zero_model() -> PhysicsInformedModel:
    scenarios = Scenarios.of(5, 430, 60)
    signature = InputSignature.fitted(("time_s",), scenarios, HORIZON_S, VIPER, LUNAR_REGOLITH)
    return PhysicsInformedModel(make_prior("motor_slope", 0.3), signature, make_residual("zero", {"input_count": 1}))


def test_errors_by_hand():
    time = np.array([0.0, 1.0])
    run = ObservedRun("a", "unit", Scenarios.of(5, 430, 60), time, np.array([0.0, 1.0]), np.array([0.2, 0.2]))
    errors = PositionErrors.between(Positions(np.array([[0.0, 4.0]]), np.array([[0.2, 4.2]])), run)
    assert (errors.final_x_m, errors.final_y_m, errors.final_m, errors.maximum_m) == pytest.approx((3, 4, 5, 5))
    assert errors.rmse_m == pytest.approx(np.sqrt(25 / 2))
    assert (errors.rmse_x_m, errors.rmse_y_m) == pytest.approx((3 / np.sqrt(2), 4 / np.sqrt(2)))


def test_prior_stands_beside_the_model_and_equals_it_without_a_residual():
    for evaluation in evaluate(zero_model(), synthetic_runs()):
        assert evaluation.model == evaluation.prior
        assert evaluation.model.final_m > 0.01


def test_maximum_is_never_below_final_or_rmse():
    for evaluation in evaluate(zero_model(), synthetic_runs()):
        errors = evaluation.model
        assert errors.maximum_m >= max(errors.final_m, errors.rmse_m)
        assert errors.rmse_m == pytest.approx(np.hypot(errors.rmse_x_m, errors.rmse_y_m))


def test_summary_takes_quantiles_over_runs():
    evaluations = evaluate(zero_model(), synthetic_runs())
    summary = summarise(evaluations)
    finals = [each.model.final_m for each in evaluations]
    assert summary["runs"] == len(evaluations)
    assert summary["model"]["final_m"] == {
        "median": pytest.approx(np.median(finals)),
        "p90": pytest.approx(np.quantile(finals, 0.9)),
        "maximum": pytest.approx(max(finals)),
    }


def test_no_runs_give_no_numbers():
    assert summarise([]) == {"runs": 0}
