"""Fits to runs whose law is known; observations, priors and start speeds on the way."""

from __future__ import annotations

import numpy as np
import pytest
import safetensors.numpy

from service.learning.drive import gauss_newton
from service.learning.drive.fit import FittedDrive, fit_drive
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.law import PARAMETERS, Basis
from service.learning.drive.model import DriveModel
from service.learning.drive.observations import observe
from service.learning.drive.priors import MOTION_DEVIATION, Whitening, fitted_parameters, parameters_of
from service.learning.drive.recorded import controls_of, track_of
from service.learning.drive.start import StartSpeeds
from service.learning.observed import ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from service.physics.scenario import Scenarios
from tests.learning.drive.made_runs import made_run, made_runs

PRIOR = make_prior("motor_slope", 0.15, VIPER, LUNAR_REGOLITH)


@pytest.fixture(scope="module")
def runs(engine) -> list[ObservedRun]:
    return made_runs(engine)


@pytest.fixture(scope="module")
def fitted(runs) -> FittedDrive:
    return fit_drive(runs, PRIOR)


def test_a_fit_follows_the_runs_that_it_saw(runs, fitted):
    for run in runs:
        error = np.abs(fitted.model.drive_run(run).x_m[0] - run.x_m)
        assert error.max() < 0.02 * max(0.5, np.abs(np.diff(run.x_m)).sum()), run.name


def test_a_run_that_was_left_out_is_predicted_from_the_others(runs, fitted):
    seen = [np.abs(fitted.model.drive_run(run).x_m[0] - run.x_m).max() for run in runs]
    left_out = [np.abs(fitted.left_out[run.name].x_m[0] - run.x_m).max() for run in runs]
    assert set(fitted.left_out) == {run.name for run in runs} == set(fitted.left_out_models)
    assert np.mean(left_out) > np.mean(seen)


def test_the_same_runs_give_the_same_model_on_any_number_of_threads(runs, fitted):
    again = fit_drive(runs, PRIOR, threads=1)
    one, two = fitted.model.tensors(), again.model.tensors()
    assert all(np.array_equal(one[name], two[name]) for name in one)
    assert fitted.model.describe() == again.model.describe()


def test_a_model_survives_its_checkpoint_to_the_bit(fitted):
    model = fitted.model
    arrays = safetensors.numpy.load(safetensors.numpy.save(model.tensors()))
    back = DriveModel.restore(model.describe(), arrays, PRIOR)
    scenarios, time = (
        Scenarios(np.radians([3.0, 24.0]), np.array([400.0, 700.0]), np.array([50.0, 90.0])),
        np.linspace(0, 12, 50),
    )
    there, here = model.positions(scenarios, time), back.positions(scenarios, time)
    assert np.array_equal(there.x_m, here.x_m)
    assert np.array_equal(there.y_m, here.y_m)


@pytest.mark.parametrize("damage", ["missing tensor", "other shape", "unknown parameter", "not finite", "one too many"])
def test_a_damaged_checkpoint_is_refused(fitted, damage):
    description, tensors = fitted.model.describe(), dict(fitted.model.tensors())
    if damage == "missing tensor":
        del tensors["weights"]
    elif damage == "other shape":
        tensors["heights"] = tensors["heights"][:-1]
    elif damage == "unknown parameter":
        description["parameters"] = description["parameters"] | {"charm": 1.0}
    elif damage == "not finite":
        tensors["weights"] = np.full_like(tensors["weights"], np.nan)
    else:
        tensors["more"] = np.zeros(1)
    with pytest.raises(ValueError, match=r"missing|shape|parameters|NaN|not part"):
        DriveModel.restore(description, tensors, PRIOR)


def test_a_fit_can_be_stopped_at_once(runs):
    def check() -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        fit_drive(runs, PRIOR, check=check)


def test_no_runs_and_too_short_runs_are_refused(runs):
    with pytest.raises(ValueError, match="without runs"):
        fit_drive([], PRIOR)
    with pytest.raises(ValueError, match="must last"):
        fit_drive([runs[0].samples(slice(0, 10))], PRIOR)


def test_steps_never_raise_the_cost(runs, monkeypatch):
    costs: list[float] = []
    found = gauss_newton.minimise

    def heard(problem, y, most_steps, _tell):
        return found(problem, y, most_steps, lambda _step, cost: costs.append(cost))

    monkeypatch.setattr("service.learning.drive.fit.minimise", heard)
    fit_drive(runs[:3], PRIOR)
    falls = np.diff(costs) <= 0
    assert len(costs) > 4
    assert (~falls).sum() <= 1  # between the two stages, which have costs of their own


def test_track_and_controls_are_read_off_a_run(engine):
    track = Track(np.array([0.7, 1.1, 2.0]), np.radians([4.0, 15.0, 8.0]))
    controls = Controls(np.array([0.0, 1.5, 3.0]), np.array([80.0, 0.0, 60.0]), np.array([0.0, 1.0, 0.0]))
    run = made_run(engine, "a drive", track, controls, mass_kg=500.0, horizon_s=6)
    read = track_of(run, VIPER)
    asked = np.linspace(0.65, float(run.x_m.max()) + 0.6, 100)
    apart = np.interp(asked, read.distance_m, read.slope_rad) - np.interp(asked, track.distance_m, track.slope_rad)
    assert np.degrees(np.abs(apart).max()) < 0.3
    back = controls_of(run)
    assert np.array_equal(back.time_s, controls.time_s)
    assert np.array_equal(back.torque_nm, controls.torque_nm)
    assert np.array_equal(back.brake, controls.brake)


def test_wheels_count_only_where_they_are_driven(runs):
    stop = observe(runs[-1], VIPER)
    braked = (stop.swept.time_s > 2.05) & (stop.swept.time_s < 2.95)
    assert braked.any()
    assert not stop.wheels_count[braked].any()
    assert stop.wheels_count[stop.swept.time_s > 3.5].all()


def test_before_runs_parameters_are_their_priors_means():
    one = parameters_of(np.zeros(len(PARAMETERS)))
    moved = parameters_of(np.ones(len(PARAMETERS)))
    assert set(np.flatnonzero(one != moved)) == set(fitted_parameters())


def test_whitened_weights_make_functions_of_the_stated_deviation():
    rng = np.random.default_rng(1)
    basis = Basis(rng.normal(size=(30, 3)), np.array([1.2, 1.5, 2.5]))
    whitening = Whitening.of(basis, basis)
    weights = whitening.weights_of(rng.normal(size=(4000, 90)))[:, :30]
    apart = (basis.centres[:, None] - basis.centres[None]) / basis.lengths
    values = weights @ np.exp(-0.5 * np.square(apart).sum(axis=-1))
    assert values.std(axis=0) == pytest.approx(MOTION_DEVIATION, rel=0.1)


def test_start_speeds_are_found_again_between_runs(engine):
    def creep(deg: float, mass: float) -> float:
        return -0.1 * np.exp((deg - 28) / 6) * (mass / 550) ** 0.2

    def started(deg: float, mass: float) -> ObservedRun:
        track = Track.constant(np.radians(deg))
        return made_run(
            engine, f"{deg} {mass}", track, Controls.constant(60.0), mass_kg=mass, horizon_s=0.5, start=creep(deg, mass)
        )

    starts = StartSpeeds.of([started(deg, mass) for deg in range(0, 31, 3) for mass in (330.0, 500.0, 800.0)])
    for deg, mass in ((4.5, 400.0), (16.0, 700.0), (26.5, 600.0)):
        found = starts.at(np.radians([deg]), np.array([mass]))[0]
        assert found == pytest.approx(creep(deg, mass), abs=0.004)
    far = starts.at(np.radians([80.0]), np.array([1e5]))
    assert np.abs(far).max() < 0.3
