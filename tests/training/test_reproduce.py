from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from model_store import DatasetNotFoundError, ModelStore
from service.datasets import Run
from service.errors import TrainingError
from service.learning.network.fit_config import FitConfig
from service.physics.scenario import Positions
from service.training.reproduce import (
    COLUMNS,
    CONTESTANTS,
    PUBLISHED,
    Effort,
    compute_ms,
    learn,
    reproduce,
    set_course,
    table,
    validation_rms_m,
)
from tests.learning.synthetic import HORIZON_S, synthetic_run
from tests.training.stored import put_dataset

SETS = {
    "paper": [(slope, 430.0, 60.0) for slope in (20.0, 22.0, 24.0, 26.0, 28.0, 30.0)],
    "mass": [(slope, 860.0, 120.0) for slope in (24.0, 28.0)],
    "space": [(5.0, 500.0, 70.0), (15.0, 700.0, 110.0), (10.0, 350.0, 40.0)],
}
BRIEF = FitConfig(epochs=1, batch_rows=64, rows_per_epoch=128)


def paper_store(path, sets=SETS) -> ModelStore:
    """A store with the three sets of the protocol, made of synthetic runs."""
    store = ModelStore.open(path, create=True)
    for name, scenarios in sets.items():
        put_dataset(store, name, [stored(name, *scenario) for scenario in scenarios])
    return store


def stored(set_name: str, slope_deg: float, mass_kg: float, torque_nm: float) -> Run:
    run = synthetic_run(slope_deg, mass_kg, torque_nm, samples=201)
    columns = {"time_s": run.time_s, "rear_x_m": run.x_m, "rear_y_m": run.y_m}
    return Run(run.name, set_name, slope_deg, mass_kg, torque_nm, HORIZON_S, columns)


@pytest.fixture(scope="module")
def reproduction(tmp_path_factory, slow):
    store = paper_store(tmp_path_factory.mktemp("reproduce") / "store")
    return reproduce(store, Effort(seeds=2, fit=BRIEF))


def test_the_table_has_every_contestant_and_what_was_published(reproduction):
    cells = table(reproduction)
    assert all(len(row) == len(COLUMNS) for row in cells)
    expected = [(each.label, each.learns_from) for each in CONTESTANTS] + [row[:2] for row in PUBLISHED]
    assert [row[:2] for row in cells] == expected
    assert len(set(expected)) == len(expected)
    for row in cells[: len(CONTESTANTS)]:
        assert all(re.match(r"\d", cell) for cell in row[2:]), row


def test_only_what_is_random_is_trained_again(reproduction):
    for row in reproduction.rows:
        finals = row.values(lambda trial: trial.unseen_errors.final_m)
        assert len(finals) == len(set(finals)) == (2 if row.contestant.architecture == "paper_network" else 1)


def test_neither_what_is_asked_nor_any_other_double_mass_is_among_the_training_runs(reproduction):
    course = reproduction.course
    assert {run.slope_deg for run in course.train} == {20.0, 22.0, 24.0, 26.0, 30.0}
    assert all(run.mass_kg != course.heavy.mass_kg for run in (*course.train, *course.space))
    assert (course.unseen.slope_deg, course.unseen.mass_kg) == (28.0, 430.0)
    assert (course.heavy.slope_deg, course.heavy.mass_kg) == (28.0, 860.0)


@pytest.mark.parametrize("contestant", CONTESTANTS, ids=lambda each: each.key)
def test_the_unseen_run_leaves_no_trace_in_a_prediction(reproduction, contestant):
    course = reproduction.course
    spoilt = replace(course.unseen, x_m=course.unseen.x_m + 50.0)
    asked = course.unseen.scenario, course.unseen.time_s
    one, other = (
        learn(contestant, each, BRIEF)(*asked).x_m for each in (course, replace(course, unseen=spoilt, heavy=spoilt))
    )
    np.testing.assert_array_equal(one, other)


def test_the_space_set_changes_the_contestant_that_learns_from_it(reproduction):
    ours = [row.typical.unseen.x_m for row in reproduction.rows if row.contestant.architecture == "drive_model"]
    assert len(ours) == 2
    assert not np.array_equal(*ours)


def test_the_typical_trial_is_the_one_with_the_median_final_error(reproduction):
    row = reproduction.row("paper_network")
    trial = row.trials[0]
    trials = tuple(
        replace(trial, seed=seed, unseen_errors=replace(trial.unseen_errors, final_m=final))
        for seed, final in ((1, 0.5), (2, 0.1), (3, 0.2))
    )
    assert replace(row, trials=trials).typical.seed == 3


def test_validation_is_the_root_of_the_papers_loss(reproduction):
    runs = reproduction.course.train
    of_scenario = {run.slope_deg: run for run in runs}

    def off_by_five_cm(scenario, time_s):
        run = of_scenario[round(float(np.degrees(scenario.slope_angle_rad[0])), 6)]
        x, y = np.interp(time_s, run.time_s, run.x_m), np.interp(time_s, run.time_s, run.y_m)
        return Positions(x[None] + 0.03, y[None] - 0.04)

    assert validation_rms_m(off_by_five_cm, runs) == pytest.approx(0.05)


def test_the_compute_time_is_for_the_papers_number_of_points(reproduction):
    run, asked = reproduction.course.unseen, []

    def predict(_scenario, time_s):
        asked.append((len(time_s), time_s[-1]))
        return Positions(time_s[None], time_s[None])

    assert compute_ms(predict, run, repeats=3) > 0
    assert asked == [(20_001, HORIZON_S)] * 3


@pytest.mark.parametrize("name", ["paper", "mass"])
def test_a_set_without_the_unseen_slope_is_refused(tmp_path, name):
    sets = SETS | {name: [each for each in SETS[name] if each[0] != 28.0]}
    with pytest.raises(TrainingError, match="28"):
        set_course(paper_store(tmp_path, sets))


def test_two_runs_at_the_unseen_slope_are_refused(tmp_path):
    store = paper_store(tmp_path, SETS | {"paper": [*SETS["paper"], (28.0, 500.0, 60.0)]})
    with pytest.raises(TrainingError, match="set paper has 2 runs at 28 deg, needed is one"):
        set_course(store)


def test_a_store_without_the_sets_says_which_is_missing(tmp_path):
    with pytest.raises(DatasetNotFoundError, match="space"):
        set_course(paper_store(tmp_path, {name: SETS[name] for name in ("paper", "mass")}))


def test_quick_is_one_seed():
    assert Effort.of(5, quick=True).seeds == 1
    assert Effort.of(5, quick=False).seeds == 5
