"""Suggested runs: a batch that spreads, keeps to the domain and to what is simulated already."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from service.errors import InvalidValueError
from service.learning.neighbourhood import Neighbourhood, TrainingRun
from service.learning.suggest import MOST_RUNS, SMALLEST_DISTANCE, SuggestedRun, suggest_runs
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.scenario import Scenarios
from service.physics.similarity import torque_ratio

SPANS = {
    "slope_deg": (0.0, 32.0),
    "mass_kg": (300.0, 900.0),
    "torque_nm": (30.0, 130.0),
    "torque_ratio": (0.1, 0.9),
    "horizon_s": (0.0, 10.0),
}
SCALES = (9.0, 0.5, 0.3)


def known_runs(seed: int, count: int, error_m: float | None = None) -> Neighbourhood:
    """Runs at random over the spans; all with the same left-out error."""
    spread = np.random.default_rng(seed).uniform(size=(count, 3))
    lowest, highest = np.array([SPANS[field] for field in ("slope_deg", "mass_kg", "torque_nm")]).T
    runs = tuple(
        TrainingRun(f"run {at}", *map(float, row), error_m)
        for at, row in enumerate(lowest + spread * (highest - lowest))
    )
    return Neighbourhood(runs, SCALES, 1.0, VIPER, LUNAR_REGOLITH)


def places(known: Neighbourhood, suggested: tuple[SuggestedRun, ...]) -> np.ndarray:
    return known.coordinates(Scenarios.stack(Scenarios.of(s.slope_deg, s.mass_kg, s.torque_nm) for s in suggested))


def with_simulated(known: Neighbourhood, suggested: tuple[SuggestedRun, ...]) -> Neighbourhood:
    runs = tuple(TrainingRun(f"new {at}", s.slope_deg, s.mass_kg, s.torque_nm, None) for at, s in enumerate(suggested))
    return replace(known, runs=known.runs + runs)


@pytest.mark.slow
@given(st.integers(0, 10_000), st.integers(1, 60), st.integers(1, 24), st.sampled_from([None, 0.0, 0.02]))
@settings(max_examples=12)
def test_a_batch_keeps_the_laws(seed, count, asked, error_m):
    known = known_runs(seed, count, error_m)
    suggested = suggest_runs(known, SPANS, asked)

    assert len(suggested) == asked
    for each in suggested:
        scenario = Scenarios.of(each.slope_deg, each.mass_kg, each.torque_nm)
        ratio = float(torque_ratio(VIPER, LUNAR_REGOLITH, scenario)[0])
        for field, value in (("slope_deg", each.slope_deg), ("mass_kg", each.mass_kg), ("torque_nm", each.torque_nm)):
            assert SPANS[field][0] <= value <= SPANS[field][1]
        assert SPANS["torque_ratio"][0] <= ratio <= SPANS["torque_ratio"][1]
        assert (each.slope_deg, each.mass_kg, each.torque_nm) == (
            round(each.slope_deg, 2),
            round(each.mass_kg, 1),
            round(each.torque_nm, 1),
        )
        assert each.horizon_s == 10.0
        nearest = known.nearest_to(known.coordinates(scenario)[0])[0]
        assert each.nearest_run == nearest.run
        assert each.distance == pytest.approx(nearest.distance, abs=1e-6)
        assert each.distance >= SMALLEST_DISTANCE
        assert (each.expected_error_m is None) == (error_m is None)
    found = places(known, suggested)
    apart = np.linalg.norm(found[:, None] - found, axis=2) + np.diag(np.full(asked, np.inf))
    assert apart.min() >= SMALLEST_DISTANCE - 1e-6


@pytest.mark.slow
@given(st.integers(0, 10_000), st.integers(1, 40), st.integers(1, 10), st.integers(0, 10))
@settings(max_examples=10)
def test_more_suggestions_keep_the_first_and_nothing_is_drawn(seed, count, asked, more):
    known = known_runs(seed, count, 0.01)

    assert suggest_runs(known, SPANS, asked + more)[:asked] == suggest_runs(known, SPANS, asked)


@pytest.mark.slow
@given(st.integers(0, 10_000), st.sampled_from([None, 0.05]))
@settings(max_examples=8)
def test_what_was_simulated_is_not_suggested_again(seed, error_m):
    known = known_runs(seed, 20, error_m)
    first = suggest_runs(known, SPANS, 8)
    again = suggest_runs(with_simulated(known, first), SPANS, 8)

    between = np.linalg.norm(places(known, first)[:, None] - places(known, again), axis=2)
    assert between.min() >= SMALLEST_DISTANCE - 1e-6


def test_without_errors_the_largest_gap_comes_first():
    known = known_runs(3, 60)
    gentle = replace(known, runs=tuple(run for run in known.runs if run.slope_deg < 16.0))
    suggested = suggest_runs(gentle, SPANS, 4)

    assert suggested[0].slope_deg > 20.0
    assert all(each.expected_error_m is None for each in suggested)


@pytest.mark.slow
@given(st.integers(0, 10_000), st.floats(0.0, 32.0))
@settings(max_examples=10)
def test_runs_follow_the_errors_but_do_not_pile_up_there(seed, slope_deg):
    """Where left-out errors are a hundred times larger, most suggestions go, each to another place."""
    calm = known_runs(seed, 60, 0.005)
    spoilt = replace(
        calm,
        runs=tuple(
            replace(run, left_out_final_error_m=0.5) if abs(run.slope_deg - slope_deg) < 6.0 else run
            for run in calm.runs
        ),
    )
    far = [np.median([abs(each.slope_deg - slope_deg) for each in suggest_runs(of, SPANS, 8)]) for of in (calm, spoilt)]
    found = places(spoilt, suggest_runs(spoilt, SPANS, 8))

    assert far[1] < 8.0
    assert far[1] <= far[0]
    assert np.linalg.norm(found[:, None] - found, axis=2).max() > 1.0


def test_expected_errors_fall_when_a_suggestion_is_simulated():
    known = known_runs(5, 40, 0.02)
    best, *_ = suggest_runs(known, SPANS, 1)
    errors_after = [each.expected_error_m for each in suggest_runs(with_simulated(known, (best,)), SPANS, 12)]

    assert best.expected_error_m > np.median(errors_after)


def test_an_input_that_never_varied_stays_where_it_was():
    runs = tuple(TrainingRun(f"s{slope}", float(slope), 430.04, 60.0, 0.01) for slope in range(20, 33, 2))
    spans = SPANS | {"slope_deg": (20.0, 32.0), "mass_kg": (430.04, 430.04), "torque_nm": (60.0, 60.0)}
    suggested = suggest_runs(Neighbourhood(runs, (2.0, 0.1, 0.1), 1.0, VIPER, LUNAR_REGOLITH), spans, 3)

    assert {(each.mass_kg, each.torque_nm) for each in suggested} == {(430.04, 60.0)}
    assert len({each.slope_deg for each in suggested}) == 3


def test_where_a_model_says_what_scenarios_are_worth_the_worthiest_come_first_and_apart():
    def worth(scenarios):
        slope = np.degrees(scenarios.slope_angle_rad)
        return np.where(scenarios.torque_nm < 60.0, 0.0, 1.0 + 9.0 * np.exp(-np.square((slope - 20.0) / 3.0)))

    known = known_runs(7, 30, 0.01)
    suggested = suggest_runs(known, SPANS, 12, worth)
    found = places(known, suggested)

    assert suggested[:5] == suggest_runs(known, SPANS, 5, worth)
    assert all(abs(each.slope_deg - 20.0) < 3.0 for each in suggested[:3])
    assert all(each.torque_nm >= 60.0 and each.distance >= SMALLEST_DISTANCE for each in suggested)
    apart = np.linalg.norm(found[:, None] - found, axis=2) + np.diag(np.full(12, np.inf))
    assert apart.min() >= SMALLEST_DISTANCE - 1e-6


def test_what_is_worth_nothing_is_not_suggested():
    with pytest.raises(InvalidValueError, match="at most 0"):
        suggest_runs(known_runs(7, 30), SPANS, 1, lambda scenarios: np.zeros(len(scenarios)))


@pytest.mark.parametrize("count", [-1, 0, 65])
def test_counts_have_bounds(count):
    with pytest.raises(InvalidValueError, match="1 to 64"):
        suggest_runs(known_runs(0, 3), SPANS, count)


def test_what_is_full_is_told():
    spans = SPANS | {"slope_deg": (10.0, 10.5), "mass_kg": (430.0, 431.0), "torque_nm": (60.0, 60.5)}
    with pytest.raises(InvalidValueError, match="at most"):
        suggest_runs(known_runs(0, 3), spans, 64)
    here = replace(known_runs(0, 1), runs=(TrainingRun("here", 10.25, 430.5, 60.2, 0.01),))
    with pytest.raises(InvalidValueError, match="at most 0"):
        suggest_runs(here, spans, 1)
    with pytest.raises(InvalidValueError, match="ranges with room"):
        suggest_runs(known_runs(0, 3), spans | {"mass_kg": (430.01, 430.02)}, 1)
    with pytest.raises(InvalidValueError, match="at most 2000"):
        suggest_runs(known_runs(0, MOST_RUNS + 1), SPANS, 1)
