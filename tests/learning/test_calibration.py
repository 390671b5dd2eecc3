from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.learning.calibration import calibrate_prior, calibrate_wheel_resistance
from service.learning.observed import ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import PRIOR_NAMES, make_prior
from service.physics.scenario import Scenarios
from service.physics.wheel_speed import wheel_speed_rad_s
from tests.learning.synthetic import synthetic_run, synthetic_runs


@pytest.mark.parametrize("name", PRIOR_NAMES)
@given(truth=st.floats(-0.5, 1.0))
def test_finds_the_coefficient_that_made_the_runs(name, truth):
    time = np.linspace(0, 5, 50)
    runs = []
    for slope in (3.0, 17.0, 29.0):
        scenario = Scenarios.of(slope, 430, 60)
        positions = make_prior(name, truth).positions(scenario, time)
        runs.append(ObservedRun(f"s{slope}", "unit", scenario, time, positions.x_m[0], positions.y_m[0]))
    assert calibrate_prior(make_prior(name), runs).coefficient == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize("name", PRIOR_NAMES)
def test_no_other_coefficient_is_closer_in_least_squares(name):
    runs = synthetic_runs()

    def squares(coefficient: float) -> float:
        prior = make_prior(name, coefficient)
        return sum(np.mean((prior.positions(run.scenario, run.time_s).x_m[0] - run.x_m) ** 2) for run in runs)

    best = calibrate_prior(make_prior(name), runs).coefficient
    assert squares(best) < min(squares(best - 1e-3), squares(best + 1e-3))


def test_each_run_weighs_the_same_however_finely_sampled():
    coarse, fine = synthetic_run(5, samples=41), synthetic_run(20, samples=41)
    finer = synthetic_run(20, samples=4001)
    prior = make_prior("motor_slope")
    assert calibrate_prior(prior, [coarse, fine]).coefficient == pytest.approx(
        calibrate_prior(prior, [coarse, finer]).coefficient, rel=0.02
    )


def test_without_runs_there_is_nothing_to_calibrate():
    with pytest.raises(ValueError, match="without runs"):
        calibrate_prior(make_prior("motor_slope"), [])


def test_wheel_resistance_is_found_again():
    runs = []
    for run in synthetic_runs():
        speed = float(wheel_speed_rad_s(VIPER, LUNAR_REGOLITH, 0.17, run.scenario)[0])
        runs.append(ObservedRun(run.name, "unit", run.scenario, run.time_s, run.x_m, run.y_m, speed))
    assert calibrate_wheel_resistance(VIPER, LUNAR_REGOLITH, runs) == pytest.approx(0.17)


def test_wheel_resistance_is_unknown_where_no_run_recorded_it():
    run = synthetic_run(5)
    silent = ObservedRun("a", "unit", run.scenario, run.time_s, run.x_m, run.y_m)
    assert calibrate_wheel_resistance(VIPER, LUNAR_REGOLITH, [silent]) is None
