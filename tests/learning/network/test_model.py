from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from service.learning.network.corrections import ZeroCorrection
from service.learning.network.inputs import INPUT_NAMES, InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import make_residual
from service.learning.observed import scenarios_of
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import PRIOR_NAMES, make_prior
from service.physics.scenario import Scenarios
from tests.learning.synthetic import HORIZON_S, synthetic_runs
from tests.physics.strategies import scenarios, times

SIGNATURE = InputSignature.fitted(INPUT_NAMES, scenarios_of(synthetic_runs()), HORIZON_S, VIPER, LUNAR_REGOLITH)


def model(prior: str = "motor_slope", architecture: str = "paper_network", **arguments: object) -> PhysicsInformedModel:
    torch.manual_seed(3)
    residual = make_residual(architecture, {"input_count": len(SIGNATURE.inputs), **arguments})
    return PhysicsInformedModel(make_prior(prior, 0.2), SIGNATURE, residual.correction())


@pytest.mark.slow
@pytest.mark.parametrize("prior", PRIOR_NAMES)
@given(batch=scenarios, time_s=times)
def test_zero_residual_equals_prior(prior, batch, time_s):
    twin = model(prior, "zero")
    expected = twin.prior.positions(batch, time_s)
    answered = twin.positions(batch, time_s)
    np.testing.assert_array_equal(answered.x_m, expected.x_m)
    np.testing.assert_array_equal(answered.y_m, expected.y_m)


@pytest.mark.slow
@given(batch=scenarios)
def test_starts_at_the_origin_with_the_mean_speed_form(batch):
    assert (model(x_form="mean_speed").positions(batch, np.array([0.0, 1.0])).x_m[:, 0] == 0.0).all()


@pytest.mark.slow
@given(batch=scenarios, time_s=times)
def test_a_batch_equals_a_loop(batch, time_s):
    twin = model(x_form="mean_speed")
    together, each = twin.positions(batch, time_s), twin.positions(batch, np.tile(time_s, (len(batch), 1)))
    for row in range(len(batch)):
        one = Scenarios(batch.slope_angle_rad[[row]], batch.mass_kg[[row]], batch.torque_nm[[row]])
        alone = twin.positions(one, time_s)
        for found in (together, each):
            np.testing.assert_array_equal(found.x_m[row], alone.x_m[0])
            np.testing.assert_array_equal(found.y_m[row], alone.y_m[0])


@pytest.mark.slow
@given(batch=scenarios, count=st.integers(1, 4000))
def test_the_answer_at_a_time_does_not_depend_on_the_other_times(batch, count):
    # whether they come one by one or by the corners of a polygon
    twin, time_s = model(), np.linspace(0, HORIZON_S, count + 1)
    whole = twin.positions(batch, time_s).x_m
    few = twin.positions(batch, time_s[::97]).x_m
    np.testing.assert_allclose(few, whole[:, ::97], rtol=0, atol=1e-10)


def test_past_the_horizon_the_correction_keeps_its_mean_speed():
    # grows in proportion to the time, not with its square or worse
    twin = model(x_form="mean_speed")
    one = Scenarios.of(12, 430, 60)
    correction = twin.corrections(one, np.array([1.0, 2.0, 10.0, 100.0]) * HORIZON_S).x_m[0]
    np.testing.assert_allclose(correction, correction[0] * np.array([1, 2, 10, 100]), rtol=1e-12)


def test_past_the_horizon_the_correction_of_a_position_stays():
    twin = model(x_form="position")
    correction = twin.corrections(Scenarios.of(12, 430, 60), np.array([1.0, 3.0]) * HORIZON_S).x_m[0]
    assert correction[1] == pytest.approx(correction[0], rel=1e-12)


def test_a_residual_for_other_inputs_is_refused():
    with pytest.raises(ValueError, match="takes 2 inputs, the signature names 5"):
        PhysicsInformedModel(make_prior("motor_slope"), SIGNATURE, ZeroCorrection(2))


def test_the_paper_network_has_the_paper_s_layers():
    shapes = [tuple(p.shape) for p in make_residual("paper_network", {"input_count": 2}).parameters() if p.ndim == 2]
    assert shapes == [(30, 2), (120, 30), (500, 120), (50, 500), (2, 50)]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"input_count": 0}, "input_count"),
        ({"input_count": 99}, "input_count"),
        ({"input_count": 2, "output_scale_m": (0.0, 1.0)}, "output_scale_m"),
        ({"input_count": 2, "x_form": "speed"}, "x_form"),
    ],
)
def test_a_network_that_cannot_be_is_refused(arguments, named):
    with pytest.raises(ValueError, match=named):
        make_residual("paper_network", arguments)


def test_an_unknown_architecture_is_refused_by_name():
    with pytest.raises(ValueError, match="allowed is one of paper_network, zero"):
        make_residual("os.system", {})
