"""What a drive model promises about its answers and its stored form."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from service.errors import CheckpointError
from service.learning.checkpoint import describe_model, restore_model, weights_bytes
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.model import DriveModel
from service.learning.observed import Controls as RunControls
from service.learning.trajectory_model import DrivesRuns
from service.physics.scenario import Scenarios
from tests.learning.drive.fitted import few_runs, small_fit
from tests.learning.synthetic import synthetic_run

TIMES = np.linspace(0.0, 10.0, 201)
ASKED = ((5, 430, 60), (28, 500, 70), (33, 430, 40), (-12, 700, 0))


@pytest.fixture(scope="module")
def model() -> DriveModel:
    return small_fit().model


def test_it_knows_runs_that_vary(model):
    assert isinstance(model, DrivesRuns)


def test_a_batch_is_the_loop_over_its_scenarios(model):
    batch = model.positions(Scenarios.stack([Scenarios.of(*each) for each in ASKED]), TIMES)
    for row, each in enumerate(ASKED):
        one = model.positions(Scenarios.of(*each), TIMES)
        assert np.array_equal(one.x_m[0], batch.x_m[row])
        assert np.array_equal(one.y_m[0], batch.y_m[row])


def test_an_answer_does_not_depend_on_what_else_is_asked(model):
    scenario = Scenarios.of(27.3, 430, 60)
    long, short = model.positions(scenario, TIMES), model.positions(scenario, TIMES[:71])
    assert np.array_equal(long.x_m[:, :71], short.x_m)
    assert np.array_equal(long.y_m[:, :71], short.y_m)
    assert model.positions(scenario, np.array([])).x_m.shape == (1, 0)


@pytest.mark.parametrize("times", [[-0.1, 1.0], [0.0, np.nan], [0.0, np.inf]])
def test_times_that_cannot_be_are_refused(model, times):
    with pytest.raises(ValueError, match="times"):
        model.positions(Scenarios.of(10, 430, 60), np.array(times))


@pytest.mark.parametrize("asked", ASKED)
def test_a_constant_scenario_is_a_drive_like_any_other(model, asked):
    slope, mass, torque = np.radians(asked[0]), asked[1], asked[2]
    controls = Controls(np.zeros(1), np.array([float(torque)]), np.array([False]))
    driven, state = model.drive(model.start(mass, slope), Track.constant(slope), controls, TIMES)
    answer = model.positions(Scenarios.of(*asked), TIMES)
    np.testing.assert_allclose(driven.x_m, answer.x_m, rtol=0, atol=1e-9)
    np.testing.assert_allclose(driven.y_m, answer.y_m, rtol=0, atol=1e-9)
    assert state.x_m == pytest.approx(answer.x_m[0, -1], abs=1e-9)


def test_a_run_whose_inputs_are_columns_but_stay_the_same_is_its_scenario(model):
    run = synthetic_run(12)
    same = np.full(len(run.time_s), run.torque_nm)
    varying = replace(run, controls=RunControls(torque_nm=same))
    constant = model.positions(run.scenario, run.time_s)
    np.testing.assert_allclose(model.drive_run(varying).x_m, constant.x_m, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(model.drive_run(run).x_m, constant.x_m)


def test_a_brake_stops_a_rover_where_it_is(model):
    (run,) = [run for run in few_runs() if run.varies]
    x = model.drive_run(run).x_m[0]
    later = x[run.time_s > 3.5]
    assert x[-1] > 0.3
    assert np.ptp(later) < 0.05


def test_more_resistance_takes_no_rover_further(model):
    for each in ASKED[:3]:
        ends = [model.positions_with(Scenarios.of(*each), TIMES, by).x_m[0, -1] for by in (-0.02, 0.0, 0.02)]
        assert ends[0] > ends[1] > ends[2]


def test_the_stored_form_is_small_and_gives_the_same_model(model):
    content = weights_bytes(model)
    assert len(content) < 100_000
    restored = restore_model(json.loads(json.dumps(describe_model(model), allow_nan=False)), content)
    assert isinstance(restored, DriveModel)
    for each in ASKED:
        one, two = model.positions(Scenarios.of(*each), TIMES), restored.positions(Scenarios.of(*each), TIMES)
        assert np.array_equal(one.x_m, two.x_m)
        assert np.array_equal(one.y_m, two.y_m)
    assert restored.start(430.0, 0.1) == model.start(430.0, 0.1)
    assert (describe_model(restored), weights_bytes(restored)) == (describe_model(model), content)


def spoiled(tensor):
    bad = tensor.copy()
    bad.flat[-1] = np.nan
    return bad


@pytest.mark.parametrize("spoil", [spoiled, lambda t: t[:-1], lambda t: t.astype(np.float32), lambda t: t[None]])
def test_misfitting_tensors_are_refused(model, spoil):
    tensors = model.tensors()
    for name in tensors:
        with pytest.raises(ValueError, match="tensor"):
            DriveModel.restore(model.describe(), {**tensors, name: spoil(tensors[name])}, model.prior)


def test_missing_and_foreign_tensors_are_refused(model):
    tensors = model.tensors()
    for name in tensors:
        fewer = {key: value for key, value in tensors.items() if key != name}
        with pytest.raises(ValueError, match="missing"):
            DriveModel.restore(model.describe(), fewer, model.prior)
    with pytest.raises(ValueError, match="stranger"):
        DriveModel.restore(model.describe(), {**tensors, "stranger": np.zeros(3)}, model.prior)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("parameters", "resistance"), "much"),
        (("parameters", "resistance"), float("nan")),
        (("parameters", "unheard_of"), 1.0),
        (("parameters",), None),
        (("motion_lengths",), [1.0, 2.0]),
        (("stall_lengths",), [1.0, 0.0, 1.0]),
        (("start", "mass_kg"), [300.0]),
        (("start",), {}),
    ],
)
def test_misfitting_descriptions_are_refused(model, path, value):
    description = describe_model(model)
    inner = description["architecture"]["arguments"]
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(CheckpointError, match=r".+"):
        restore_model(description, weights_bytes(model))
