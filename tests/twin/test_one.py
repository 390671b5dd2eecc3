"""One scenario in one call of the engine: the same as many at once by arrays."""

from __future__ import annotations

import numpy as np
import pytest

import model_store
from model_store import ModelStore
from service.learning.drive.library import MOST_S
from service.learning.drive.timetable import Timetable
from service.twin import Scenario, Twin, sample_times
from service.twin.load import load_twin
from service.twin.one import AnswersAtOnce, table_of

SCENARIOS = [
    Scenario(slope, mass, torque, 10.0)
    for slope in (-28.0, 0.0, 14.9, 21.0, 26.5, 31.0)
    for mass, torque in ((430.0, 60.0), (300.0, 0.0), (900.0, 95.0))
]


@pytest.fixture(scope="module")
def champion() -> Twin:
    store = ModelStore.open(next(iter(model_store.__path__)))
    resolved = store.resolve("viper-lunar")
    return load_twin(store, resolved.name, resolved.version)


@pytest.mark.parametrize("scenario", SCENARIOS, ids=str)
def test_one_scenario_is_told_as_one_of_many(champion, scenario):
    times = sample_times(scenario.horizon_s, 0.05)
    one = champion.predict(scenario, times, with_speed=True, with_wheel_speed=True)
    many = champion.predict_many(SCENARIOS, times, with_speed=True, with_wheel_speed=True)
    same = many[SCENARIOS.index(scenario)]

    assert list(one.trajectory) == list(same.trajectory)
    for name, column in one.trajectory.items():
        assert np.array_equal(column, same.trajectory[name]), name
    assert one.summary.outcome is same.summary.outcome
    for name in ("final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio"):
        expected = getattr(same.summary, name)
        near = None if expected is None else pytest.approx(expected, rel=1e-12, abs=1e-14)
        assert getattr(one.summary, name) == near, name
    assert one.domain == same.domain


def test_the_champion_answers_at_once(champion):
    assert isinstance(champion.model, AnswersAtOnce)


def test_a_table_is_kept_for_times_that_nobody_can_change_only():
    kept, own = sample_times(3.0, 0.5), sample_times(3.0, 0.5).copy()
    assert table_of(kept, (1.0,)) is table_of(kept, (1.0,))
    assert table_of(own, (1.0,)) is not table_of(own, (1.0,))


@pytest.mark.parametrize("wrong", [-1e-9, np.nan, np.inf, 2 * MOST_S])
def test_no_table_has_times_that_cannot_be(wrong):
    with pytest.raises(ValueError, match="times must be 0 to"):
        Timetable(np.array([0.0, wrong]), np.array([0.0, 1.0]), np.empty(0), 1)
