"""Trained networks as they answer, beside torch in float64: the same function, however it is computed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from model_store import WEIGHTS, ModelStore
from service.learning.checkpoint import restore_model, weights_bytes
from service.learning.network.corrections import PaperCorrection, ZeroCorrection, make_correction
from service.learning.network.residuals import PaperNetwork, make_residual
from service.physics.scenario import Scenarios
from service.settings import Settings

INPUTS = 5
PAPER = "viper-lunar-paper"
TIMES = np.linspace(-1, 1, 2001)


def residual(seed: int = 1, gain: float = 1.0, **arguments: object) -> PaperNetwork:
    """Random weights; those of the time and the biases times `gain`, so that lines have more corners."""
    torch.manual_seed(seed)
    made = make_residual("paper_network", {"input_count": INPUTS, **arguments})
    with torch.no_grad():
        made.state_dict()["layers.0.weight"][:, 0] *= gain
        made.state_dict()["layers.0.bias"][:] *= gain
    return made


def by_torch(made: torch.nn.Module, columns: np.ndarray, times: np.ndarray, dtype=torch.float64) -> np.ndarray:
    """dx and dy, (2, scenario, time), row by row through torch."""
    count = times.shape[1]
    rows = np.column_stack([times.ravel(), np.repeat(columns, count, axis=0)])
    with torch.inference_mode():
        answer = made.to(dtype)(torch.from_numpy(rows).to(dtype)).numpy()
    return np.moveaxis(answer.reshape(len(columns), count, 2), -1, 0)


def columns(rows: int, seed: int = 0, reach: float = 1.5) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-reach, reach, (rows, INPUTS - 1))


@pytest.mark.parametrize("x_form", ["position", "mean_speed"])
@pytest.mark.parametrize("count", [1, 7, 199, 200, 257, 5001])
@pytest.mark.parametrize("gain", [1.0, 20.0])
def test_the_answer_is_torch_s_in_float64(x_form, count, gain):
    made = residual(count, gain, x_form=x_form, output_scale_m=(0.7, 0.01))
    correction, others = made.correction(), columns(4)
    times = np.random.default_rng(1).uniform(-1, 2, (4, count))  # in no order, and past the horizon
    np.testing.assert_allclose(correction.metres(others, times), by_torch(made, others, times), rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def shipped():
    """The shipped network: model, and the residual in torch."""
    store = ModelStore.open(Settings().store_url)
    manifest = store.manifest(PAPER, 1)
    weights = store.read_file(manifest, WEIGHTS)
    model = restore_model(manifest.checkpoint, weights)
    made = make_residual("paper_network", manifest.checkpoint["architecture"]["arguments"])
    made.load_state_dict({name: torch.from_numpy(each.copy()) for name, each in model.correction.tensors.items()})
    assert weights_bytes(model) == weights
    return model, made


def test_the_shipped_network_answers_to_a_millionth_of_a_micrometre_wherever_it_is_asked(shipped):
    model, made = shipped
    random = np.random.default_rng(3)
    runs = model.signature
    asked = Scenarios(np.radians(random.uniform(-45, 45, 60)), random.uniform(50, 5000, 60), random.uniform(0, 500, 60))
    others, times = runs.scenario_columns(asked), np.tile(TIMES, (60, 1))
    exact = by_torch(made, others, times)
    size = np.maximum(1.0, np.abs(exact).max(axis=(0, 2)))  # far outside its domain it says kilometres
    answered = model.correction.metres(others, times)
    assert (np.abs(answered - exact).max(axis=(0, 2)) <= 1e-12 * size).all()
    eager = by_torch(made, others, times, torch.float32)
    assert (np.abs(answered - eager).max(axis=(0, 2)) <= 1e-4 * size).all()


@given(seed=st.integers(0, 50), gain=st.sampled_from([0.0, 0.1, 1.0, 5.0, 50.0]))
def test_a_line_is_a_polygon_with_these_corners(seed, gain):
    line = residual(seed, gain).correction().layers.line(columns(1, seed)[0])
    polygon = line.polygon(-1.0, 1.0, most=10_000)
    places = polygon.places
    assert (places[0], places[-1]) == (-1.0, 1.0)
    assert (np.diff(places) >= 0).all()
    np.testing.assert_allclose(polygon.values.T, line.at(places), rtol=0, atol=1e-12)
    between = (places[1:] + places[:-1]) / 2
    np.testing.assert_allclose(polygon.at(between), line.at(between), rtol=0, atol=1e-12)


def test_rows_at_once_do_not_show():
    line = residual().correction().layers.line(columns(1)[0])
    whole = line.at(TIMES)
    for step in (1, 7, 100, 256, 300):
        parts = [line.at(TIMES[first : first + step]) for first in range(0, len(TIMES), step)]
        np.testing.assert_allclose(np.concatenate(parts, axis=1), whole, rtol=0, atol=1e-13)


def test_each_scenario_gets_the_same_bits_alone_in_any_company_and_on_any_thread():
    correction, others, times = residual().correction(), columns(12), np.tile(TIMES, (12, 1))
    together = correction.metres(others, times)
    with ThreadPoolExecutor(4) as threads:
        alone = list(threads.map(lambda row: correction.metres(others[[row]], times[[row]]), range(12)))
    np.testing.assert_array_equal(np.concatenate(alone, axis=1), together)
    backwards = correction.metres(others[::-1], times)[:, ::-1]
    np.testing.assert_array_equal(backwards, together)


@pytest.mark.parametrize("step", [2, 3, 7, 10])
def test_a_time_gets_the_same_bits_among_any_two_hundred_others(step):
    correction, others = residual(x_form="mean_speed").correction(), columns(1)
    few = correction.metres(others, TIMES[None, ::step])
    np.testing.assert_array_equal(few, correction.metres(others, TIMES[None])[:, :, ::step])
    ordered = correction.metres(others, np.concatenate([TIMES[::-1], [5.0]])[None])
    np.testing.assert_array_equal(ordered[:, :, -2::-1], correction.metres(others, TIMES[None]))


def test_a_line_with_too_many_corners_is_asked_time_by_time(monkeypatch):
    made, others, times = residual(), columns(1), TIMES[None]
    correction = made.correction()
    line = correction.layers.line(others[0])
    corners = len(line.polygon(-1.0, 1.0, most=10_000).places)
    assert line.polygon(-1.0, 1.0, most=corners) is not None
    assert line.polygon(-1.0, 1.0, most=corners - 1) is None
    monkeypatch.setattr("service.learning.network.corrections._MOST_CORNERS", corners - 1)
    np.testing.assert_allclose(correction.metres(others, times), by_torch(made, others, times), rtol=0, atol=1e-12)


def changed(change) -> tuple[PaperNetwork, PaperCorrection]:
    made = residual()
    with torch.no_grad():
        for name, tensor in made.state_dict().items():
            change(name, tensor)
    return made, made.correction()


@pytest.mark.parametrize(
    "change",
    [
        lambda _name, tensor: tensor.zero_(),
        lambda name, tensor: tensor.fill_(-1.0),  # every unit is dead
        lambda name, tensor: tensor.fill_(1.0) if name.endswith("weight") else tensor.zero_(),  # all cross together
        lambda name, tensor: tensor.copy_(tensor.sign()),  # corners in the same place, units that are zero at ends
    ],
    ids=["zero", "dead", "together", "signs"],
)
def test_networks_with_nothing_random_about_them(change):
    made, correction = changed(change)
    for others in (np.zeros((1, 4)), np.ones((1, 4)), columns(1)):
        expected = by_torch(made.double(), others, TIMES[None])
        size = max(1.0, np.abs(expected).max())
        np.testing.assert_allclose(correction.metres(others, TIMES[None]), expected, rtol=0, atol=1e-13 * size)
        made.float()


@pytest.mark.parametrize("scale", [1e20, 3e37])
@pytest.mark.parametrize("count", [5, 500])
def test_what_float32_cannot_hold_is_infinite_and_never_a_number_or_nan(scale, count):
    def larger(_name: str, tensor: torch.Tensor) -> None:
        tensor.mul_(scale)

    _, correction = changed(larger)
    times = np.linspace(-1, 1, count)[None]
    with np.errstate(all="raise", under="ignore"):  # nor does it warn
        answered = correction.metres(columns(1), times)
    assert np.isinf(answered).any()
    assert not np.isnan(answered).any()


def test_scenarios_far_from_all_others_give_finite_or_infinite_numbers():
    correction, times = residual().correction(), np.tile(np.linspace(-1, 1, 300), (4, 1))
    far = np.array([[1e6] * 4, [-1e30] * 4, [1e300] * 4, [-1e308] * 4])
    answered = correction.metres(far, times)
    assert np.isfinite(answered[:, :2]).all()
    assert np.isinf(answered[:, 2:]).all()


def test_no_scenarios_and_no_times_have_no_corrections():
    for correction in (residual().correction(), ZeroCorrection(INPUTS)):
        assert correction.metres(np.empty((0, 4)), np.empty((0, 9))).shape == (2, 0, 9)
    assert ZeroCorrection(INPUTS).metres(columns(2), np.ones((2, 3))).tolist() == np.zeros((2, 2, 3)).tolist()


def test_an_unknown_architecture_is_refused_by_name():
    with pytest.raises(ValueError, match="allowed is one of paper_network, zero"):
        make_correction("os.system", {}, {})


@pytest.mark.parametrize("count", [5, 500])
def test_units_that_are_no_number_are_not_taken_for_units_that_are_off(count):
    others = np.zeros((1, INPUTS - 1))
    others[0, 0] = np.inf  # in the second layer that is infinity minus infinity
    assert np.isinf(residual().correction().metres(others, np.linspace(-1, 1, count)[None])).all()


def test_times_that_are_asked_twice_get_the_same_bits():
    correction, few = residual().correction(), np.linspace(-1, 1, 50)
    twice = correction.metres(columns(1), np.concatenate([few, few[::-1]])[None])
    np.testing.assert_array_equal(twice[:, :, :50], correction.metres(columns(1), few[None]))
    np.testing.assert_array_equal(twice[:, :, 50:], twice[:, :, 49::-1])
