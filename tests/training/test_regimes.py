"""Left-out runs by what their rovers did: each run in one regime, and the pairs are of the same runs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from model_store import CorruptArtefactError, ModelStore
from service.training.evidence import read_evidence
from service.training.regimes import (
    CLIMBS,
    DOWN,
    DRIVES,
    LONG,
    REGIMES,
    SLIDES,
    SLOW,
    by_regime,
    left_out_runs,
    pairs,
    regime_of,
    varying_runs,
)
from tests.training.test_gate import put, row


@pytest.mark.parametrize(
    ("run", "regime"),
    [
        ((20, 60, 10, 3.0, False), CLIMBS), ((20, 60, 10, 0.9, False), SLOW), ((20, 60, 10, -0.1, False), SLOW),
        ((30, 60, 10, -0.2, False), SLIDES), ((-5, 60, 10, 5.0, False), DOWN), ((5, 0, 10, -3.0, False), DOWN),
        ((20, 60, 30, 9.0, False), LONG), ((20, 60, 30, 9.0, True), DRIVES),
    ],
)  # fmt: skip
def test_a_run_is_in_the_first_regime_that_fits(run, regime):
    *scenario, varies = run
    assert regime_of(*scenario, varies=varies) == regime


errors = st.lists(st.tuples(st.floats(0, 5), st.floats(-3, 9), st.booleans()), min_size=1, max_size=20)


@given(found=errors)
@settings(max_examples=40, deadline=None)
def test_regimes_share_out_the_runs_and_no_error_is_lost(found):
    rows = [row(f"r{n}", error, final_x_m=end) | {"varies": varies} for n, (error, end, varies) in enumerate(found)]
    store = ModelStore.open("memory://")
    runs = left_out_runs(store.manifest("rover", put(store, left_out=rows)))
    regimes = by_regime(runs)

    assert sum(each.runs for each in regimes) == len(found)
    assert [each.regime for each in regimes] == [name for name in REGIMES if name in {run.regime for run in runs}]
    for each in regimes:
        members = [run.model.final_m for run in runs if run.regime == each.regime]
        assert each.final.median_m == np.median(members)
        assert each.final.median_m <= each.final.p90_m <= max(members)


def test_pairs_are_of_runs_that_both_have_and_swap_with_the_sides():
    store = ModelStore.open("memory://")
    shared = [row(f"r{n}", 0.1 * n, final_x_m=n + 1.5) for n in range(6)]
    ours = store.manifest("rover", put(store, left_out=[*shared, row("mine", 9.0)]))
    theirs = store.manifest(
        "rover", put(store, left_out=[row(each["run"], 0.5, final_x_m=each["final_x_m"]) for each in shared])
    )
    one, other = read_evidence(store, ours), read_evidence(store, theirs)
    forth, back = (pairs(*sides, varying_runs(ours, theirs)) for sides in ((one, other), (other, one)))

    assert sum(each.runs for each in forth) == 6
    assert [(each.candidate_final, each.against_final) for each in forth] == [
        (each.against_final, each.candidate_final) for each in back
    ]


def test_rows_that_are_none_are_damage():
    store = ModelStore.open("memory://")
    version = put(store, left_out=[row("r") | {"horizon_s": 0}])

    with pytest.raises(CorruptArtefactError, match=r"horizon_s.*publish the version anew"):
        left_out_runs(store.manifest("rover", version))
