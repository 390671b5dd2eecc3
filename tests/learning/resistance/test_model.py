"""What the resistance process promises about its trajectories and its stored form."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.learning.left_out import left_out_slopes
from service.learning.observed import ObservedRun, scenarios_of
from service.learning.resistance.engine import Engine
from service.learning.resistance.fit import FittedProcess, fit_resistance_process
from service.learning.resistance.model import ResistanceProcess
from service.physics.parameters import LUNAR_REGOLITH, VIPER, RoverParameters
from service.physics.priors import make_prior
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import torque_ratio
from tests.learning.resistance import reference

TIMES = np.linspace(0.0, 10.0, 2001)


def test_every_trajectory_starts_at_zero_and_at_the_learned_height(
    fitted: FittedProcess, paper_runs: list[ObservedRun]
):
    answer = fitted.model.positions(scenarios_of(paper_runs), TIMES)
    assert answer.x_m.shape == answer.y_m.shape == (13, 2001)
    assert (answer.x_m[:, 0] == 0.0).all()
    np.testing.assert_allclose(answer.y_m[:, 0], [run.y_m[0] for run in paper_runs], atol=2e-4)


def test_a_slope_is_predicted_without_its_run(fitted: FittedProcess, paper_runs: list[ObservedRun]):
    for run in paper_runs:
        left_out = fitted.left_out[run.name]
        assert left_out.x_m.shape == left_out.y_m.shape == (1, len(run.time_s))
        if run.slope_deg <= 29:
            assert abs(left_out.x_m[0, -1] - run.x_m[-1]) < 0.03, run.name
            assert abs(left_out.y_m[0, -1] - run.y_m[-1]) < 0.004, run.name


def test_left_out_runs_are_left_out(fitted: FittedProcess, paper_runs: list[ObservedRun]):
    run = next(run for run in paper_runs if run.slope_deg == 24)
    rest = [other for other in paper_runs if other is not run]
    prior = fitted.model.prior
    without = fit_resistance_process(rest, VIPER, LUNAR_REGOLITH, prior).model.positions(run.scenario, run.time_s)
    # Only the traction curves and the start's mean still know the run.
    np.testing.assert_allclose(fitted.left_out[run.name].x_m, without.x_m, atol=0.006)
    with_it = fitted.model.positions(run.scenario, run.time_s)
    assert np.abs(with_it.x_m - run.x_m).max() < np.abs(without.x_m - run.x_m).max()


@pytest.mark.slow
def test_a_slope_left_out_of_its_series_is_as_if_never_seen(fitted: FittedProcess, paper_runs: list[ObservedRun]):
    prior, heavy = fitted.model.prior, replace(paper_runs[8], name="heavy", scenario=Scenarios.of(28, 860, 120))

    def fit(runs: Sequence[ObservedRun]) -> FittedProcess:
        return fit_resistance_process(runs, VIPER, LUNAR_REGOLITH, prior)

    left_out = left_out_slopes([heavy, *paper_runs], lambda runs: fit(runs).left_out)
    assert left_out.keys() == {run.name for run in paper_runs}
    for run in paper_runs[::4]:  # 20, 24, 28 and 32 degrees
        without = fit([other for other in paper_runs if other is not run])
        truly = without.model.positions(run.scenario, run.time_s)
        # only the traction curves and the start's mean, of the whole series, differ
        np.testing.assert_allclose(left_out[run.name].x_m, truly.x_m, atol=0.002)
        np.testing.assert_allclose(left_out[run.name].y_m, truly.y_m, atol=0.0002)


def test_a_batch_is_the_loop_over_its_scenarios(fitted: FittedProcess):
    scenarios = Scenarios.stack([Scenarios.of(s, m, t) for s, m, t in ((5, 430, 60), (28, 500, 70), (33, 430, 40))])
    batch = fitted.model.positions(scenarios, TIMES)
    for row, (s, m, t) in enumerate(((5, 430, 60), (28, 500, 70), (33, 430, 40))):
        one = fitted.model.positions(Scenarios.of(s, m, t), TIMES)
        assert np.array_equal(one.x_m[0], batch.x_m[row])
        assert np.array_equal(one.y_m[0], batch.y_m[row])


def test_an_answer_does_not_depend_on_what_else_is_asked(fitted: FittedProcess):
    scenario = Scenarios.of(27.3, 430, 60)
    long, short = fitted.model.positions(scenario, TIMES), fitted.model.positions(scenario, TIMES[:701])
    assert np.array_equal(long.x_m[:, :701], short.x_m)
    assert np.array_equal(long.y_m[:, :701], short.y_m)
    assert fitted.model.positions(scenario, np.array([])).x_m.shape == (1, 0)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    st.floats(-45, 45),
    st.floats(0, 4).map(lambda exponent: 10**exponent),
    st.one_of(st.just(0.0), st.floats(-2, 4).map(lambda exponent: 10**exponent)),
    st.sampled_from([3.0, 60.0, 600.0]),
)
def test_every_scenario_has_a_finite_and_bounded_answer(
    fitted: FittedProcess, slope: float, mass: float, torque: float, horizon: float
):
    time = np.linspace(0.0, horizon, 1001)
    answer = fitted.model.positions(Scenarios.of(slope, mass, torque), time)
    assert np.isfinite(answer.x_m).all()
    assert np.isfinite(answer.y_m).all()
    speed = np.abs(np.diff(answer.x_m[0])) / np.diff(time)
    rim = VIPER.wheel_radius_m * VIPER.no_load_speed_rad_s
    # A mean over two samples knows the speed up to the end of the step that the later one lies in.
    assert (speed <= np.maximum(1.2 * rim, LUNAR_REGOLITH.gravity_m_s2 * (time[1:] + 0.1)) + 1e-9).all()
    assert (np.abs(answer.y_m - VIPER.wheel_radius_m) < 0.2).all()


@given(st.floats(20, 45), st.floats(1, 4).map(lambda exponent: 10**exponent))
@settings(max_examples=30, deadline=None)
def test_no_rover_slides_back_faster_than_gravity_pulls(fitted: FittedProcess, slope: float, mass: float):
    time = np.linspace(0.0, 30.0, 1501)
    x = fitted.model.positions(Scenarios.of(slope, mass, 0.5), time).x_m[0]
    start_speed = 0.3  # m/s, more than any release gives
    gained = start_speed + LUNAR_REGOLITH.gravity_m_s2 * np.sin(np.radians(slope)) * (time[1:] + 0.1)
    assert (-np.diff(x) / np.diff(time) <= gained).all()


@given(st.floats(20, 29))
@settings(max_examples=20, deadline=None)
def test_a_climbing_rover_goes_on_past_the_trained_horizon(fitted: FittedProcess, slope: float):
    time = np.linspace(0.0, 120.0, 1201)
    x = fitted.model.positions(Scenarios.of(slope, 430, 60), time).x_m[0]
    speeds = np.diff(x)[150:] / 0.1
    assert (speeds > 0).all()
    assert speeds.max() - speeds[-1] < 0.1 * speeds[-1] + 0.01


@pytest.mark.slow
def test_the_steps_are_fine_enough(fitted: FittedProcess, paper_runs: list[ObservedRun]):
    climbing = scenarios_of([run for run in paper_runs if run.x_m[-1] > 0.5])
    shipped, model = fitted.model.positions(climbing, TIMES), fitted.model
    finer = Engine(
        model.prior,
        model.hyper,
        model.curves,
        model.features,
        model.time_knots_s,
        model.resistance,
        model.height,
        model.start,
        refine=16,
    )
    ratio = torque_ratio(VIPER, LUNAR_REGOLITH, climbing)
    x, y = finer.predict(climbing.slope_angle_rad, climbing.mass_kg, ratio, TIMES)
    assert np.abs(shipped.x_m - x)[:, -1].max() < 1e-3
    assert np.abs(shipped.x_m - x).max() < 2e-3  # where the rover at 30 deg, sliding back, turns round
    assert np.abs(shipped.y_m - y).max() < 1e-3
    assert not np.array_equal(shipped.x_m, x)
    np.testing.assert_allclose(x, reference.positions(model, climbing, TIMES, refine=16).x_m, rtol=0, atol=1e-9)


def test_fitting_twice_gives_the_same_model(fitted: FittedProcess, paper_runs: list[ObservedRun]):
    again = fit_resistance_process(paper_runs, VIPER, LUNAR_REGOLITH, fitted.model.prior).model
    assert again.describe() == fitted.model.describe()
    for name, tensor in fitted.model.tensors().items():
        assert np.array_equal(tensor, again.tensors()[name]), name


def test_the_stored_form_is_small_and_gives_the_same_model(fitted: FittedProcess):
    model = fitted.model
    tensors = model.tensors()
    assert sum(tensor.nbytes for tensor in tensors.values()) < 1_000_000
    restored = ResistanceProcess.restore(json.loads(json.dumps(model.describe())), tensors, model.prior)
    for scenario in (Scenarios.of(28, 430, 60), Scenarios.of(-10, 900, 20)):
        one, two = model.positions(scenario, TIMES), restored.positions(scenario, TIMES)
        assert np.array_equal(one.x_m, two.x_m)
        assert np.array_equal(one.y_m, two.y_m)


def _nan(tensor: Array) -> Array:
    spoiled = tensor.copy()
    spoiled.flat[-1] = np.nan
    return spoiled


@pytest.mark.parametrize("spoil", [_nan, lambda t: t[:-1], lambda t: t.astype(np.float32), lambda t: t[None]])
def test_misfitting_tensors_are_refused(fitted: FittedProcess, spoil: Callable[[Array], Array]):
    model, tensors = fitted.model, fitted.model.tensors()
    for name in tensors:
        with pytest.raises(ValueError, match=r"tensor|knots"):
            ResistanceProcess.restore(model.describe(), {**tensors, name: spoil(tensors[name])}, model.prior)


def test_missing_and_foreign_tensors_are_refused(fitted: FittedProcess):
    model, tensors = fitted.model, fitted.model.tensors()
    for name in tensors:
        with pytest.raises(ValueError, match="missing"):
            ResistanceProcess.restore(
                model.describe(), {key: value for key, value in tensors.items() if key != name}, model.prior
            )
    with pytest.raises(ValueError, match="stranger"):
        ResistanceProcess.restore(model.describe(), {**tensors, "stranger": np.zeros(3)}, model.prior)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("hyperparameters", "mean_resistance"), float("nan")),
        (("hyperparameters", "gate_width"), 0.0),
        (("hyperparameters", "unheard_of"), 1.0),
        (("hyperparameters", "resistance", "travel_length"), 0.0),
        (("hyperparameters", "resistance", "level_lengths"), [1.0, 2.0]),
        (("hyperparameters", "height", "noise_deviation"), "much"),
        (("traction", "front", "slip_scale"), 0.0),
        (("traction", "front"), 3.0),
        (("traction", "sideways"), {}),
    ],
)
def test_misfitting_descriptions_are_refused(fitted: FittedProcess, path: tuple[str, ...], value: object):
    description = json.loads(json.dumps(fitted.model.describe()))
    inner = description
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    with pytest.raises(ValueError, match=r".+"):
        ResistanceProcess.restore(description, fitted.model.tensors(), fitted.model.prior)


def test_fitting_says_what_it_cannot_use(paper_runs: list[ObservedRun]):
    prior = make_prior("motor_slope", 0.2)
    with pytest.raises(ValueError, match="three runs"):
        fit_resistance_process(paper_runs[:2], VIPER, LUNAR_REGOLITH, prior)
    with pytest.raises(ValueError, match="repeat"):
        fit_resistance_process([*paper_runs, paper_runs[0]], VIPER, LUNAR_REGOLITH, prior)
    endless = RoverParameters(0.25, 0.2, 1.2836, 4, 0.6277, 0.748, float("inf"))
    with pytest.raises(ValueError, match="no_load_speed_rad_s"):
        fit_resistance_process(paper_runs, endless, LUNAR_REGOLITH, prior)
    with pytest.raises(ValueError, match="prior"):
        fit_resistance_process(paper_runs, VIPER, LUNAR_REGOLITH, make_prior("motor_slope", 0.2, endless))
