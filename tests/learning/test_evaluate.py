from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from service.errors import TrainingError
from service.learning.evaluate import PositionErrors, evaluate, summarise, way_m
from service.learning.network.corrections import ZeroCorrection
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.observed import Controls, ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from service.physics.scenario import Positions, Scenarios
from tests.learning.synthetic import HORIZON_S, synthetic_run, synthetic_runs


def zero_model() -> PhysicsInformedModel:
    scenarios = Scenarios.of(5, 430, 60)
    signature = InputSignature.fitted(("time_s",), scenarios, HORIZON_S, VIPER, LUNAR_REGOLITH)
    return PhysicsInformedModel(make_prior("motor_slope", 0.3), signature, ZeroCorrection(1))


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


def test_summary_has_errors_relative_to_the_way():
    evaluations = evaluate(zero_model(), synthetic_runs())
    relative = [each.relative_final for each in evaluations]
    assert summarise(evaluations)["relative"]["final"]["p90"] == pytest.approx(np.quantile(relative, 0.9))


def test_no_runs_give_no_numbers():
    assert summarise([]) == {"runs": 0}


def braked() -> ObservedRun:
    run = synthetic_run(10)
    return replace(run, name="braked", controls=Controls(brake=run.time_s > 2))


@dataclass
class Driven:
    """A model that knows runs that vary: it says of each that it ends 2 cm too far."""

    prior = make_prior("motor_slope", 0.3)
    quick = True

    def positions(self, scenarios: Scenarios, time_s: np.ndarray) -> Positions:
        return self.prior.positions(scenarios, time_s)

    def drive_run(self, run: ObservedRun) -> Positions:
        return Positions(run.x_m[None] + 0.02, run.y_m[None])


def test_a_run_that_varies_has_no_prior_beside_it():
    evaluation, other = evaluate(Driven(), [braked(), synthetic_run(10)])
    assert (evaluation.varies, other.varies) == (True, False)
    assert evaluation.prior is None
    assert evaluation.model.final_m == pytest.approx(0.02)
    assert other.model == other.prior
    assert summarise([evaluation]).keys() == {"runs", "model", "relative"}
    assert summarise([evaluation, other])["prior"]["final_m"]["maximum"] == other.prior.final_m


def test_a_model_that_does_not_know_such_runs_refuses_them():
    with pytest.raises(TrainingError, match="braked"):
        evaluate(zero_model(), [synthetic_run(5), braked()])


def test_relative_errors_are_over_the_way_up_and_down_half_a_metre_at_least():
    run = synthetic_run(10)
    time = run.time_s
    there_and_back = replace(run, x_m=1.0 - np.cos(2 * np.pi * time / time[-1]))
    assert way_m(there_and_back) == pytest.approx(4.0, abs=0.01)
    hardly = replace(run, x_m=0.1 * time / time[-1])
    for each, way in ((there_and_back, way_m(there_and_back)), (hardly, 0.5)):
        (found,) = evaluate(zero_model(), [each])
        assert found.way_m == way_m(each)
        assert found.relative_final == pytest.approx(found.model.final_m / way)
        assert found.relative_maximum == pytest.approx(found.model.maximum_m / way)


def test_vibration_is_no_way():
    run = synthetic_run(10, samples=4001)
    trembling = replace(run, x_m=run.x_m + 0.001 * np.sin(2 * np.pi * 200 * run.time_s))
    assert way_m(trembling) == pytest.approx(way_m(run), abs=0.01)
