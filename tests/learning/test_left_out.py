"""Which runs stand for "the other slopes of a series"; what the model then makes of them is tested with the model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from service.learning.left_out import left_out_slopes
from service.learning.observed import ObservedRun
from service.physics.scenario import Positions, Scenarios

SERIES = st.tuples(st.sampled_from(["paper", "space"]), st.sampled_from([430.0, 860.0]), st.sampled_from([60.0, 120.0]))
PLACES = st.lists(st.tuples(SERIES, st.integers(-3, 6)), max_size=60)


def runs_at(places: Sequence[tuple[tuple[str, float, float], int]]) -> list[ObservedRun]:
    """The x of each run is its place in the list, so that predictions can tell where they come from."""
    time = np.array([0.0, 1.0])
    return [
        ObservedRun(f"r{at}", name, Scenarios.of(slope, mass, torque), time, np.full(2, float(at)), time)
        for at, ((name, mass, torque), slope) in enumerate(places)
    ]


def seen(runs: Sequence[ObservedRun]) -> dict[str, Positions]:
    """Instead of a prediction the places of all the other runs."""
    others = {run.name: np.array([[other.x_m[0] for other in runs if other is not run]]) for run in runs}
    return {name: Positions(each, each) for name, each in others.items()}


@given(PLACES, st.integers(3, 6))
def test_a_run_is_predicted_from_all_other_slopes_of_its_series_and_nothing_else(places, fewest):
    runs = runs_at(places)
    found = left_out_slopes(runs, seen, fewest)
    for at, (series, slope) in enumerate(places):
        slopes = {other for same, other in places if same == series}
        first = (series, slope) not in places[:at]
        assert (f"r{at}" in found) == (first and len(slopes) >= fewest)
        if f"r{at}" in found:
            others = [places[int(other)] for other in found[f"r{at}"].x_m[0]]
            assert {same for same, _ in others} == {series}
            assert sorted(other for _, other in others) == sorted(slopes - {slope})


def test_what_is_no_series_costs_nothing():
    def never(_runs: Sequence[ObservedRun]) -> dict[str, Positions]:
        raise AssertionError("nothing to leave out")

    assert left_out_slopes([], never) == {}
    assert left_out_slopes(runs_at([(("paper", 430.0, 60.0), slope) for slope in range(4)]), never) == {}
