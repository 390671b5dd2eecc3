from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from model_store import ModelStore
from service.physics.frames import world_to_slope
from service.twin import Frame, NonFiniteError, Outcome, Scenario, Twin, sample_times
from service.twin.load import load_twin
from tests.twin.published import network_model, publish

scenarios = st.builds(Scenario, st.floats(-45, 45), st.floats(50, 2000), st.floats(0, 300), st.floats(0.1, 30))


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Twin:
    store = ModelStore.open(tmp_path_factory.mktemp("store"))
    return load_twin(store, "unit", publish(store).version)


@pytest.fixture(scope="module")
def learned(tmp_path_factory: pytest.TempPathFactory) -> Twin:
    store = ModelStore.open(tmp_path_factory.mktemp("store"))
    return load_twin(store, "unit", publish(store, model=network_model()).version)


@given(scenario=scenarios)
def test_zero_residual_answers_the_prior(twin, scenario):
    prediction = twin.predict(scenario, sample_times(scenario.horizon_s, 0.5), with_prior=True)
    for name in ("x_m", "y_m"):
        np.testing.assert_array_equal(prediction.trajectory[name], prediction.prior[name])
    assert prediction.prior_name == "motor_slope"


@given(scenario=scenarios)
def test_summary_agrees_with_the_trajectory(learned, scenario):
    prediction = learned.predict(scenario, sample_times(scenario.horizon_s, 0.25))
    x, y, summary = prediction.trajectory["x_m"], prediction.trajectory["y_m"], prediction.summary
    assert (summary.final_x_m, summary.final_y_m) == (x[-1], y[-1])
    # float32: the summary's own times share no rounding with the samples
    assert summary.mean_speed_m_s == pytest.approx((x[-1] - x[0]) / scenario.horizon_s, abs=1e-5 / scenario.horizon_s)
    assert summary.distance_m >= np.hypot(x[-1] - x[0], y[-1] - y[0]) - 1e-5


@given(scenario=scenarios, dt_s=st.floats(0.05, 2))
def test_outcome_and_final_position_do_not_depend_on_the_sampling(learned, scenario, dt_s):
    fine = learned.predict(scenario, sample_times(scenario.horizon_s, 0.05)).summary
    coarse = learned.predict(scenario, sample_times(scenario.horizon_s, dt_s)).summary
    assert coarse.outcome == fine.outcome
    assert coarse.final_x_m == pytest.approx(fine.final_x_m, abs=1e-4)
    assert coarse.slip_ratio == pytest.approx(fine.slip_ratio, abs=1e-2)


@given(scenario=scenarios, first=st.floats(0.01, 1))
def test_a_trajectory_that_is_shown_late_began_at_rest_all_the_same(learned, scenario, first):
    whole = learned.predict(scenario, np.array([0.0, first * scenario.horizon_s / 2, scenario.horizon_s]))
    late = learned.predict(scenario, whole.trajectory["time_s"][1:])
    last = learned.predict(scenario, whole.trajectory["time_s"][2:])
    for shown in (late, last):
        for name in ("final_x_m", "final_y_m", "mean_speed_m_s", "distance_m"):
            assert getattr(shown.summary, name) == pytest.approx(getattr(whole.summary, name), abs=1e-4), name
        assert shown.summary.outcome == whole.summary.outcome


def test_a_slow_rover_does_not_climb_because_it_is_shown_late(twin):
    asked = [Scenario(10, 430, torque, 4) for torque in np.linspace(0, 100, 4001)]
    whole = twin.predict_many(asked, sample_times(4, 1))
    slow = (whole.summaries.mean_speed_m_s > 0.006) & (np.array(whole.summaries.outcome) == Outcome.STALLS)
    assert slow.any()
    for row in slow.nonzero()[0]:
        assert twin.predict(asked[row], np.array([2.0, 4.0])).summary.outcome is Outcome.STALLS


@pytest.mark.slow
@given(scenario=scenarios)
def test_frames_hold_the_same_points(learned, scenario):
    times = sample_times(scenario.horizon_s, 0.5)
    slope, world = (learned.predict(scenario, times, frame, with_prior=True) for frame in (Frame.SLOPE, Frame.WORLD))
    assert list(world.trajectory) == ["time_s", "x_m", "z_m"]
    for positions in ("trajectory", "prior"):
        there, here = getattr(world, positions), getattr(slope, positions)
        x, y = world_to_slope(there["x_m"], there["z_m"], np.radians(scenario.slope_deg))
        np.testing.assert_allclose(x, here["x_m"], atol=1e-9)
        np.testing.assert_allclose(y, here["y_m"], atol=1e-9)
    assert world.summary == slope.summary


@pytest.mark.parametrize(
    ("slope_deg", "torque_nm", "outcome"),
    [(5, 60, Outcome.CLIMBS), (40, 5, Outcome.SLIDES)],
)
def test_outcomes_of_a_clear_case(twin, slope_deg, torque_nm, outcome):
    assert twin.predict(Scenario(slope_deg, 430, torque_nm, 4), sample_times(4, 0.1)).summary.outcome is outcome


def test_a_rover_that_hardly_moves_stalls(twin):
    # the motor prior balances where 4 tau/(m g R_w) = sin th + c cos th: at 10 deg, 430 kg and c = 0.3 that is 20.4 N m
    torque = 430 * 1.62 * 0.25 / 4 * (np.sin(np.radians(10)) + 0.3 * np.cos(np.radians(10)))
    summary = twin.predict(Scenario(10, 430, torque, 4), sample_times(4, 0.1)).summary
    assert summary.outcome is Outcome.STALLS
    assert abs(summary.mean_speed_m_s) < 1e-6


def test_slip_ratio_is_unknown_when_the_version_does_not_know_its_wheels(twin):
    silent = replace(twin, wheel_motion_resistance=None)
    assert silent.predict(Scenario(5, 430, 60, 4), sample_times(4, 0.1)).summary.slip_ratio is None


def test_the_domain_is_judged(twin):
    inside = twin.predict(Scenario(10, 430, 60, 4), sample_times(4, 1)).domain
    outside = twin.predict(Scenario(21, 430, 60, 4), sample_times(4, 1)).domain
    assert inside.inside
    assert [reason.field for reason in outside.reasons] == ["slope_deg"]


def test_what_is_not_finite_is_never_answered(twin):
    with pytest.raises(NonFiniteError, match="unit@1 has no finite answer"):
        twin.predict(Scenario(10, 430, 60, 1e200), np.array([0.0, 1e200]))


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=5)
@given(st.lists(scenarios, min_size=8, max_size=8))
def test_threads_get_the_answers_of_a_loop(learned, batch):
    def final(scenario: Scenario) -> float:
        return learned.predict(scenario, sample_times(scenario.horizon_s, 0.01)).summary.final_x_m

    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(final, batch))
    assert together == [final(scenario) for scenario in batch]
