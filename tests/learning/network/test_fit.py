from __future__ import annotations

import math
from itertools import islice, pairwise

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from service.errors import InvalidValueError, TrainingError
from service.learning.network.fit import FitOutcome, NetworkFit, position_loss_m2
from service.learning.network.fit_config import FitConfig, learning_rate_at
from service.learning.network.fit_state import FitState
from service.learning.network.inputs import InputSignature
from service.learning.network.residuals import PaperNetwork, Residual, ZeroResidual
from service.learning.network.rows import Rows, rows_of
from service.learning.observed import scenarios_of
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from tests.learning.synthetic import HORIZON_S, synthetic_runs

CPU = torch.device("cpu")
QUICK = FitConfig(seed=5, epochs=6, batch_rows=128, rows_per_epoch=512, warm_up_epochs=1)


def rows() -> tuple[Rows, Rows]:
    runs = synthetic_runs()
    signature = InputSignature.fitted(
        ("time_s", "slope_deg", "mass_kg", "torque_nm"), scenarios_of(runs), HORIZON_S, VIPER, LUNAR_REGOLITH
    )
    every = rows_of(runs, make_prior("motor_slope", 0.3), signature)
    return every, Rows(every.inputs[3::4], every.targets_m[3::4])


def network(seed: int = 1) -> Residual:
    torch.manual_seed(seed)
    return PaperNetwork(4, (0.5, 0.02))


def weights(residual: Residual) -> dict[str, torch.Tensor]:
    return {name: tensor.clone() for name, tensor in residual.state_dict().items()}


def assert_same(one: dict[str, torch.Tensor], two: dict[str, torch.Tensor]) -> None:
    assert one.keys() == two.keys()
    for name in one:
        assert torch.equal(one[name], two[name]), name


def fit(residual: Residual, train: Rows, validation: Rows, config: FitConfig) -> FitOutcome:
    """All epochs in one go."""
    fit = NetworkFit(residual, train, validation, config, device=CPU)
    assert [reached.epoch for reached in fit.epochs()] == list(range(1, fit.epoch + 1))
    return fit.finish()


@pytest.mark.slow
def test_learns_what_the_prior_leaves():
    train, validation = rows()
    residual = network()
    outcome = fit(residual, train, validation, FitConfig(epochs=40, batch_rows=64, rows_per_epoch=1000))
    untrained = float(train.targets_m.square().sum(dim=1).mean())
    with torch.inference_mode():
        trained = float(position_loss_m2(residual(train.inputs), train.targets_m))
    assert trained < untrained / 100
    assert outcome.validation_loss_m2 == pytest.approx(trained, rel=0.5)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_weights_and_another_seed_others():
    train, validation = rows()
    one, two, other = network(), network(), network()
    fit(one, train, validation, QUICK)
    fit(two, train, validation, QUICK)
    fit(other, train, validation, FitConfig(**{**_fields(QUICK), "seed": 6}))
    assert_same(weights(one), weights(two))
    assert any(not torch.equal(weights(one)[name], weights(other)[name]) for name in weights(one))


@pytest.mark.slow
@pytest.mark.parametrize("chunk", [1, 2, 5])
@pytest.mark.parametrize("anew", [True, False], ids=["from saved bytes", "in the same fit"])
def test_in_chunks_equals_undisturbed(chunk, anew):
    train, validation = rows()
    undisturbed, chunked = network(), network()
    expected = fit(undisturbed, train, validation, QUICK)
    part, done = NetworkFit(chunked, train, validation, QUICK, device=CPU), 0
    while not part.finished:
        reached = [each.epoch for each in islice(part.epochs(), chunk)]
        assert reached == list(range(done + 1, min(done + chunk, QUICK.epochs) + 1))
        done = part.epoch
        if anew:
            # a new process would start from fresh weights: nothing but the saved bytes may matter
            state, chunked = FitState.from_bytes(part.state().to_bytes()), network(seed=99)
            part = NetworkFit(chunked, train, validation, QUICK, resume=state, device=CPU)
    outcome = part.finish()
    assert_same(weights(chunked), weights(undisturbed))
    assert (outcome.epochs, outcome.best_epoch) == (expected.epochs, expected.best_epoch)
    assert outcome.validation_loss_m2 == expected.validation_loss_m2
    assert not outcome.stopped_early


def test_finished_before_its_end_it_keeps_the_best_so_far():
    train, validation = rows()
    residual = network()
    left = NetworkFit(residual, train, validation, QUICK, device=CPU)
    losses = [reached.validation_loss_m2 for reached in islice(left.epochs(), 3)]
    best, outcome = left.state().best, left.finish()
    assert_same(weights(residual), best)
    assert (outcome.epochs, outcome.stopped_early, outcome.validation_loss_m2) == (3, True, min(losses))


def test_without_weights_there_is_no_epoch_and_the_loss_is_that_of_the_prior():
    train, validation = rows()
    outcome = fit(ZeroResidual(4), train, validation, QUICK)
    assert (outcome.epochs, outcome.best_epoch, outcome.stopped_early) == (0, 0, False)
    assert outcome.validation_loss_m2 == float(validation.targets_m.square().sum(dim=1).mean())


def test_stops_early_without_gain_and_keeps_the_best():
    train, validation = rows()
    # at such a rate the loss soon gets worse
    config = FitConfig(epochs=200, batch_rows=32, rows_per_epoch=256, learning_rate=0.3, patience_epochs=4)
    residual = network()
    hasty = NetworkFit(residual, train, validation, config, device=CPU)
    losses = [reached.validation_loss_m2 for reached in hasty.epochs()]
    outcome = hasty.finish()
    assert outcome.stopped_early
    assert outcome.epochs == outcome.best_epoch + 4 < 200
    assert outcome.validation_loss_m2 == min(losses)
    with torch.inference_mode():
        kept = float(position_loss_m2(residual(validation.inputs), validation.targets_m))
    assert kept == pytest.approx(outcome.validation_loss_m2, rel=1e-4)


def test_progress_counts_every_epoch():
    train, validation = rows()
    seen = list(NetworkFit(network(), train, validation, QUICK, device=CPU).epochs())
    assert [progress.epoch for progress in seen] == [1, 2, 3, 4, 5, 6]
    assert all(progress.epochs == 6 and progress.elapsed_s > 0 for progress in seen)
    assert seen[-1].remaining_s == 0


def test_a_loss_that_is_not_finite_ends_the_fit():
    train, validation = rows()
    broken = Rows(train.inputs, torch.full_like(train.targets_m, math.nan))
    with pytest.raises(TrainingError, match="not finite after epoch 1"):
        fit(network(), broken, validation, QUICK)


def test_equation_4_by_hand():
    predicted, expected = torch.tensor([[1.0, 2.0], [0.0, 0.0]]), torch.tensor([[0.0, 0.0], [0.0, 3.0]])
    assert float(position_loss_m2(predicted, expected)) == (1 + 4 + 9) / 2


@given(st.integers(0, 20), st.integers(1, 200))
def test_the_learning_rate_rises_then_falls_to_its_end(warm_up, epochs):
    config = FitConfig(epochs=epochs + warm_up, warm_up_epochs=warm_up)
    rates = [learning_rate_at(config, epoch) for epoch in np.linspace(0, config.epochs, 400)]
    top = int(np.argmax(rates))
    assert rates[top] <= config.learning_rate
    assert all(a <= b for a, b in pairwise(rates[: top + 1]))
    assert all(a >= b for a, b in pairwise(rates[top:]))
    assert rates[-1] == pytest.approx(config.final_learning_rate)


@pytest.mark.parametrize("data", [b"", b"not safetensors", b"\x08\0\0\0\0\0\0\0{}      "])
def test_bytes_that_are_no_state_are_refused(data):
    with pytest.raises(TrainingError, match="saved state"):
        FitState.from_bytes(data)


@pytest.mark.parametrize(("field", "value"), [("epochs", 0), ("learning_rate", math.nan), ("seed", -1)])
def test_a_config_that_makes_no_fit_names_the_field(field, value):
    with pytest.raises(InvalidValueError, match=f"{field} is .*allowed is"):
        FitConfig(**{field: value})


def _fields(config: FitConfig) -> dict[str, object]:
    return {name: getattr(config, name) for name in config.__dataclass_fields__}
