"""Speeds, and a summary that does not depend on the points that were asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import model_store
from model_store import ModelStore
from service.errors import InvalidValueError
from service.twin import SPEED_NAMES, Frame, NonFiniteError, Outcome, Scenario, Twin, sample_grid, sample_times
from service.twin.load import load_twin
from service.twin.mobility import mobility_map
from tests.twin.published import network_model, publish
from tests.twin.rolling import Rolling, rolling

scenarios = st.builds(
    Scenario, st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300), st.sampled_from([0.05, 4.0, 10.0, 600.0])
)
shares = st.sets(st.floats(0, 1, exclude_max=True), max_size=20).map(sorted)


@pytest.fixture(scope="module")
def champion() -> Twin:
    store = ModelStore.open(next(iter(model_store.__path__)))
    resolved = store.resolve("viper-lunar")
    return load_twin(store, resolved.name, resolved.version)


@pytest.fixture(scope="module")
def twin() -> Twin:
    store = ModelStore.open("memory://")
    return load_twin(store, "unit", publish(store).version)


@pytest.fixture(scope="module", params=["drive", "rolling"])
def exact(request, champion) -> Twin:
    return champion if request.param == "drive" else rolling(champion)


@given(scenario=scenarios, chosen=shares)
@settings(max_examples=30)
def test_the_summary_is_the_same_whatever_points_are_asked_for(exact, scenario, chosen):
    horizon = scenario.horizon_s
    last = np.array([horizon])
    plain, many = exact.predict(scenario, last).summary, exact.predict_many([scenario] * 2, last).summaries[1]
    own = np.unique([*(share * horizon for share in chosen), horizon])
    for times in (np.linspace(0, horizon, 2), np.linspace(0, horizon, 201), np.linspace(0, horizon, 20_001), own):
        assert exact.predict(scenario, times).summary == plain
        assert exact.predict(scenario, times, Frame.WORLD, with_speed=True, with_prior=True).summary == plain
        assert exact.predict_many([scenario] * 2, times).summaries[1] == many


@given(scenario=scenarios, chosen=shares)
@settings(max_examples=10, deadline=None)
def test_the_summary_of_a_network_is_the_same_but_for_its_rounding(twin, scenario, chosen):
    learned = replace(twin, model=network_model())
    whole = learned.predict(scenario, np.linspace(0, scenario.horizon_s, 201)).summary
    own = np.unique([*(share * scenario.horizon_s for share in chosen), scenario.horizon_s])
    found = learned.predict(scenario, own).summary

    for name in ("final_x_m", "final_y_m", "distance_m"):
        assert getattr(found, name) == pytest.approx(getattr(whole, name), rel=1e-6, abs=1e-5), name


def test_the_way_there_and_back_counts(champion):
    """At 28 deg the rover slips back before it climbs: its way is longer than it gets."""
    summary = champion.predict(Scenario(28, 430, 60, 10), np.array([10.0])).summary

    assert summary.outcome is Outcome.CLIMBS
    assert summary.distance_m > summary.final_x_m + 0.05


@given(scenario=scenarios, chosen=shares)
@settings(max_examples=20)
def test_the_speed_of_a_time_does_not_depend_on_the_others(exact, scenario, chosen):
    times = np.linspace(0, scenario.horizon_s, 101)
    whole = exact.predict(scenario, times, with_speed=True).trajectory
    rows = np.unique([*(int(100 * share) for share in chosen), 100])
    some = exact.predict(scenario, times[rows], with_speed=True).trajectory

    assert list(whole) == ["time_s", "x_m", "y_m", "speed_m_s"]
    for name, column in some.items():
        np.testing.assert_array_equal(column, whole[name][rows], err_msg=name)


@given(scenario=scenarios.filter(lambda each: each.horizon_s <= 10))
@settings(max_examples=20)
def test_the_speed_adds_up_to_the_way(champion, scenario):
    found = champion.predict(scenario, sample_times(scenario.horizon_s, 0.001), with_speed=True).trajectory
    time, x, speed = found["time_s"], found["x_m"], found["speed_m_s"]
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))])

    # a rover that is let go creeps at once, at up to 0.2 m/s, downhill
    assert abs(speed[0]) < 0.2
    assert speed[0] * scenario.slope_deg <= 1e-3
    assert np.abs(way - (x - x[0])).max() < 1e-5


def test_speeds_are_along_the_slope_in_both_frames(exact):
    scenario, times = Scenario(20, 430, 60, 4), sample_times(4, 0.1)
    slope, world = (exact.predict(scenario, times, frame, with_speed=True).trajectory for frame in Frame)

    assert list(world) == ["time_s", "x_m", "z_m", "speed_m_s"]
    np.testing.assert_array_equal(world["speed_m_s"], slope["speed_m_s"])


def test_wheel_speeds_of_a_model_that_does_not_know_them_are_refused(twin):
    scenario, times = Scenario(20, 430, 60, 4), sample_times(4, 0.1)
    words = "include is 'wheel_speed', allowed is speed; unit@1 does not know how fast its wheels turn"
    with pytest.raises(InvalidValueError, match=words):
        twin.predict(scenario, times, with_wheel_speed=True)
    with pytest.raises(InvalidValueError, match=words):
        twin.predict_many([scenario], times, with_wheel_speed=True)


def test_a_model_that_knows_its_wheels_says_how_they_turn_and_slip(twin):
    wheeled = rolling(twin)
    asked = [Scenario(slope, 430, torque, horizon) for slope, torque, horizon in ((2, 60, 4), (30, 60, 10), (2, 0, 4))]
    times = sample_grid([each.horizon_s for each in asked], 0.25)
    batch = wheeled.predict_many(asked, times, with_speed=True, with_wheel_speed=True)

    for row, scenario in enumerate(asked):
        alone = wheeled.predict(scenario, times[row, : batch.counts[row]], with_speed=True, with_wheel_speed=True)
        truth = Rolling(twin.model.prior).motion(scenario.as_physics(), alone.trajectory["time_s"])
        for name in SPEED_NAMES:
            np.testing.assert_array_equal(alone.trajectory[name], getattr(truth, name)[0], err_msg=name)
            np.testing.assert_array_equal(batch[row].trajectory[name], alone.trajectory[name], err_msg=name)
        assert batch[row].summary.slip_ratio == alone.summary.slip_ratio
    # uphill the wheels turn 1.375 times as fast as the rover rolls, downhill as fast the other way
    assert batch[0].summary.slip_ratio == pytest.approx(1 - 1 / 1.375)
    assert batch[1].summary.slip_ratio == pytest.approx(1 + 1 / 1.375)
    assert batch[2].summary.slip_ratio is None


def test_a_map_has_the_slips_of_the_predictions(twin):
    wheeled, torques, slopes = rolling(twin), [0.0, 60.0], [2.0, 5.0, 30.0]
    found = mobility_map(wheeled, 430, torques, slopes, 4.0, 0.9)

    for row, torque in enumerate(torques):
        for column, slope in enumerate(slopes):
            alone = wheeled.predict(Scenario(slope, 430, torque, 4.0), np.array([4.0])).summary
            expected = None if alone.slip_ratio is None else pytest.approx(alone.slip_ratio)
            assert found.slip_ratio[row][column] == expected


def test_a_point_that_is_not_finite_is_never_answered(twin):
    """The summary's own times may all be finite where a point of the answer is not."""

    class Leaping(Rolling):
        def motion(self, scenarios, time_s):
            found = super().motion(scenarios, time_s)
            found.x_m[:, time_s == 1.2345] = np.inf
            return found

    leaping = replace(twin, model=Leaping(twin.model.prior))
    assert leaping.predict(Scenario(2, 430, 60, 4), np.array([1.0, 4.0])).summary.distance_m > 0
    with pytest.raises(NonFiniteError):
        leaping.predict(Scenario(2, 430, 60, 4), np.array([1.2345, 4.0]))
