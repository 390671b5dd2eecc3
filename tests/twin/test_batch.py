"""`predict_many` answers what `predict` answers one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import model_store
from model_store import ModelStore
from service.errors import InvalidValueError
from service.twin import Frame, NonFiniteError, Outcome, Prediction, Scenario, Twin, sample_grid, sample_times
from service.twin.batch import predict_finite
from service.twin.load import load_twin
from tests.twin.published import network_model, publish_banded

inputs = st.tuples(st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300))
horizons = st.sampled_from([0.05, 0.3, 4.0, 10.0, 13.37])


@pytest.fixture(scope="module")
def champion() -> Twin:
    store = ModelStore.open(next(iter(model_store.__path__)))
    resolved = store.resolve("viper-lunar")
    return load_twin(store, resolved.name, resolved.version)


@pytest.fixture(scope="module")
def banded() -> Twin:
    store = ModelStore.open("memory://")
    return load_twin(store, "unit", publish_banded(store).version)


def assert_same(one: Prediction, other: Prediction, atol: float) -> None:
    assert (one.scenario, one.frame, one.prior_name) == (other.scenario, other.frame, other.prior_name)
    assert (one.prior is None) == (other.prior is None)
    for mine, theirs in ((one.trajectory, other.trajectory), (one.prior or {}, other.prior or {})):
        assert list(mine) == list(theirs)
        for name, column in mine.items():
            np.testing.assert_allclose(column, theirs[name], rtol=1e-9, atol=atol)
    assert one.summary.outcome is other.summary.outcome
    for name in ("final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio"):
        expected = getattr(other.summary, name)
        loose = 1e3 * atol / other.scenario.horizon_s
        assert getattr(one.summary, name) == (
            None if expected is None else pytest.approx(expected, rel=1e-6, abs=loose)
        )
    assert [reason.field for reason in one.domain.reasons] == [reason.field for reason in other.domain.reasons]
    assert one.domain.inside == other.domain.inside
    assert [run.run for run in one.domain.nearest_runs] == [run.run for run in other.domain.nearest_runs]
    assert (one.band is None) == (other.band is None)
    if one.band is not None and other.band is not None:
        assert one.band.level == other.band.level
        for name, column in one.band.columns().items():
            np.testing.assert_allclose(column, other.band.columns()[name], rtol=1e-9, atol=10 * atol)


@given(st.lists(st.tuples(inputs, horizons), min_size=1, max_size=40), st.sampled_from(["slope", "world", "band"]))
@settings(max_examples=12, deadline=None)
def test_many_are_the_loop(champion, asked, form):
    frame, level = Frame.WORLD if form == "world" else Frame.SLOPE, 0.9 if form == "band" else None
    scenarios = [Scenario(*each, horizon) for each, horizon in asked]
    times = sample_grid([scenario.horizon_s for scenario in scenarios], 0.1)
    batch = champion.predict_many(scenarios, times, frame, level, with_prior=True, with_speed=True)

    assert len(batch) == len(scenarios)
    for scenario, found in zip(scenarios, batch, strict=True):
        times = sample_times(scenario.horizon_s, 0.1)
        alone = champion.predict(scenario, times, frame, level, with_prior=True, with_speed=True)
        assert_same(found, alone, 1e-9)


@pytest.mark.parametrize("rows", [1, 2, 7])
def test_a_batch_moves_and_is_summed_up_as_each_alone_to_the_bit(champion, rows):
    rng = np.random.default_rng(rows)
    scenarios = [Scenario(*each, 10.0) for each in rng.uniform([-5, 300, 20], [35, 800, 120], (rows, 3))]
    times = sample_times(10.0, 0.5)
    for found, scenario in zip(champion.predict_many(scenarios, times), scenarios, strict=True):
        alone = champion.predict(scenario, times)
        assert found.summary == alone.summary
        for name, column in alone.trajectory.items():
            assert found.trajectory[name].tobytes() == column.tobytes()


@pytest.mark.slow
@given(st.lists(st.tuples(inputs, horizons), min_size=1, max_size=10), st.booleans())
@settings(max_examples=15, deadline=None)
def test_many_are_the_loop_for_a_network(banded, asked, with_band):
    # float32: the same to a hundredth of a millimetre, not to the last digit
    twin = replace(banded, model=network_model(), wheel_motion_resistance=None)
    scenarios = [Scenario(*each, horizon) for each, horizon in asked]
    times = sample_grid([scenario.horizon_s for scenario in scenarios], 0.1)
    level = 0.9 if with_band else None
    for scenario, found in zip(scenarios, twin.predict_many(scenarios, times, band_level=level), strict=True):
        alone = twin.predict(scenario, sample_times(scenario.horizon_s, 0.1), band_level=level)
        np.testing.assert_allclose(found.trajectory["x_m"], alone.trajectory["x_m"], rtol=1e-9, atol=1e-5)
        np.testing.assert_allclose(found.trajectory["time_s"], alone.trajectory["time_s"], rtol=0, atol=0)
        assert found.summary.final_x_m == pytest.approx(alone.summary.final_x_m, abs=1e-5)
        assert (found.band is None) == (alone.band is None)


def test_climbing_stalling_and_sliding_rovers_share_a_batch(champion):
    slopes = np.linspace(10, 45, 30)
    rovers = [(430.0, 60.0), (747.0, 31.3)]  # the second one, with so weak a motor, stalls over a range of slopes
    times = sample_times(10.0, 0.05)
    batch = champion.predict_many([Scenario(float(slope), *rover, 10) for rover in rovers for slope in slopes], times)

    assert set(batch.summaries.outcome) == set(Outcome)
    assert batch.trajectory["x_m"].shape == (60, 201)
    assert batch.time_s is times
    assert (batch.counts == 201).all()
    for row in (0, 25, 35, 59, -1):
        assert_same(batch[row], champion.predict(batch.scenarios[row], times), 1e-9)


def test_the_order_does_not_matter(champion):
    rng = np.random.default_rng(5)
    scenarios = [Scenario(*rng.uniform([0, 300, 30, 1], [35, 900, 130, 20])) for _ in range(50)]
    order = rng.permutation(50)
    here = champion.predict_many(scenarios, sample_grid([each.horizon_s for each in scenarios], 0.5))
    turned = [scenarios[at] for at in order]
    there = champion.predict_many(turned, sample_grid([each.horizon_s for each in turned], 0.5))
    for row, at in enumerate(order):
        assert_same(there[row], here[int(at)], 1e-9)


def test_a_grid_of_one_horizon_is_shared_and_others_are_filled_up():
    np.testing.assert_array_equal(sample_grid([1.0, 1.0], 0.3), sample_times(1.0, 0.3))
    np.testing.assert_array_equal(sample_grid([1.0, 0.5], 0.5), [[0.0, 0.5, 1.0], [0.0, 0.5, 0.5]])
    with pytest.raises(InvalidValueError, match="horizon_s"):
        sample_grid([1.0, float("nan")], 0.5)


def test_a_row_has_its_own_samples_only(banded):
    scenarios = [Scenario(10, 430, 60, 4), Scenario(12, 430, 60, 1.25)]
    batch = banded.predict_many(scenarios, sample_grid([4, 1.25], 0.5), band_level=0.8, with_prior=True)

    assert batch.counts.tolist() == [9, 4]
    assert batch[1].trajectory["time_s"].tolist() == [0.0, 0.5, 1.0, 1.25]
    assert len(batch[1].band.x_lower_m) == len(batch[1].prior["x_m"]) == 4
    with pytest.raises(IndexError):
        batch[2]


@pytest.mark.parametrize(
    ("count", "times"),
    [(0, np.array([0.0, 4.0])), (2, np.zeros((3, 2))), (2, np.array([0.0, 3.0])), (2, np.zeros((2, 0)))],
)
def test_times_that_do_not_fit_are_refused(banded, count, times):
    with pytest.raises(ValueError, match="times"):
        banded.predict_many([Scenario(10, 430, 60, 4)] * count, times)


def test_the_scenario_without_a_finite_answer_is_named(banded):
    scenarios = [Scenario(10, 430, 60, 4), Scenario(11, 430, 60, 1e200)]
    times = np.array([[0.0, 4.0], [0.0, 1e200]])
    with pytest.raises(NonFiniteError, match=r"slope_deg=11"):
        banded.predict_many(scenarios, times)


@pytest.mark.parametrize("bad", [[], [0], [3, 4], [9], list(range(10))])
def test_what_has_no_finite_answer_stops_nothing_else(banded, bad):
    scenarios = [Scenario(10 + row, 430, 60, 1e200 if row in bad else 4) for row in range(10)]
    times = np.array([[0.0, scenario.horizon_s] for scenario in scenarios])
    calls = []

    def predict(rows):
        calls.append(len(rows))
        return banded.predict_many([scenarios[row] for row in rows], times[rows])

    batch, rows, failed = predict_finite(predict, np.arange(10))
    assert sorted(failed) == bad
    assert rows.tolist() == [row for row in range(10) if row not in bad]
    assert (batch is None) == (len(bad) == 10)
    if batch is not None:
        assert tuple(batch.scenarios) == tuple(scenarios[row] for row in rows)
        assert_same(batch[-1], banded.predict(scenarios[rows[-1]], times[rows[-1]]), 1e-9)
    assert len(calls) <= (2 + 8 * len(bad) if bad else 1)


def test_some_of_a_batch_are_those_rows(banded):
    rng = np.random.default_rng(6)
    scenarios = [Scenario(*rng.uniform([0, 300, 30, 1], [35, 900, 130, 20])) for _ in range(12)]
    times = sample_grid([each.horizon_s for each in scenarios], 0.5)
    whole, rows = banded.predict_many(scenarios, times, band_level=0.8), np.array([7, 0, 11])
    some = whole.only(rows)
    assert len(some) == 3
    for mine, row in zip(some, rows.tolist(), strict=True):
        assert_same(mine, whole[row], 0.0)
    assert whole.only(rows[:0]).trajectory["x_m"].shape[0] == 0


def test_what_is_outside_is_named_without_the_verdicts(champion):
    rng = np.random.default_rng(7)
    scenarios = [Scenario(*rng.uniform([-10, 200, 5, 1], [45, 2000, 200, 20])) for _ in range(60)]
    batch = champion.predict_many(scenarios, sample_grid([each.horizon_s for each in scenarios], 0.5))
    expected = [[reason.field for reason in each.domain.reasons] for each in batch]
    assert batch.domain.outside_of() == expected
    assert [bool(each) for each in expected] == (~batch.domain.inside).tolist()
    assert {name for names in expected for name in names} >= {"joint", "mass_kg", "torque_ratio"}
