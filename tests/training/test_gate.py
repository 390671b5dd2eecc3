"""The promotion gate: laws over random errors, and each way in which a comparison would be unfair."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import model_store
from model_store import CorruptArtefactError, Lineage, ManifestDraft, ModelStore, VersionNotFoundError
from service.errors import InvalidValueError
from service.training import promotion
from service.training.gate import FLOOR_M, LEAST_COMMON_RUNS, Verdict, compare, compare_versions

LAWS = settings(max_examples=60, deadline=None, derandomize=True, database=None)
ERRORS_M = st.floats(0.0, 3.0)
MARGINS = st.floats(0.0, 0.5)


def row(run, error_m=0.05, *, final_m=None, slope_deg=20.0, final_x_m=1.0):
    model = {"rmse_m": error_m, "final_m": error_m if final_m is None else final_m, "maximum_m": error_m}
    scenario = {"slope_deg": slope_deg, "mass_kg": 430.0, "torque_nm": 60.0, "horizon_s": 10.0}
    return {"run": run, "set_name": "s", **scenario, "final_x_m": final_x_m, "model": model, "prior": model}


def rows(errors_m, **more):
    # every run ends elsewhere, as simulations do
    return [row(f"r{number}", error, final_x_m=number / 7, **more) for number, error in enumerate(errors_m)]


def put(store, *, test=None, left_out=(), train=(), name="rover"):
    """Publish a version with these rows of errors."""
    draft = ManifestDraft(
        created_by="tests",
        checkpoint={},
        domain={},
        metrics={"test": {"by_run": test}, "left_out": {"by_run": list(left_out)}},
        lineage=Lineage(split={"train": [each["run"] for each in train]}),
    )
    files = {"weights.safetensors": b"w", "report/train.json": json.dumps({"by_run": list(train)}).encode()}
    return store.publish(name, files, draft).version


@pytest.fixture
def store():
    return ModelStore.open("memory://")


def judge(candidate, against, margin=0.05):
    """The comparison of two lists of errors on the same runs."""
    store = ModelStore.open("memory://")
    versions = put(store, test=rows(candidate)), put(store, test=rows(against))
    return compare(store, "rover", *versions, margin=margin)


PAIRS = st.lists(st.tuples(ERRORS_M, ERRORS_M), min_size=LEAST_COMMON_RUNS, max_size=30)


@pytest.mark.slow
@LAWS
@given(pairs=PAIRS, margin=MARGINS)
def test_of_two_versions_at_most_one_is_better(pairs, margin):
    ours, theirs = zip(*pairs, strict=True)
    one, other = judge(ours, theirs, margin), judge(theirs, ours, margin)
    assert not (one.promote and other.promote)
    assert one.ratio * other.ratio == pytest.approx(1.0)
    assert one.common_runs == len(pairs)


@pytest.mark.slow
@LAWS
@given(errors=st.lists(ERRORS_M, min_size=LEAST_COMMON_RUNS, max_size=30), margin=MARGINS)
def test_a_version_is_never_better_than_its_equal(errors, margin):
    same = judge(errors, errors, margin)
    assert (same.verdict, same.ratio) == (Verdict.NOT_BETTER, 1.0)


@pytest.mark.slow
@LAWS
@given(
    errors=st.lists(st.floats(0.1, 1.0), min_size=LEAST_COMMON_RUNS, max_size=20),
    factor=st.floats(0.05, 3.0),
    margin=MARGINS,
)
def test_errors_a_factor_smaller_pass_exactly_when_the_margin_says_so(errors, factor, margin):
    assume(abs(factor - (1 - margin)) > 1e-9)
    scaled = judge([factor * error for error in errors], errors, margin)
    assert scaled.ratio == pytest.approx(factor)
    assert scaled.promote == (factor < 1 - margin)


@pytest.mark.slow
@LAWS
@given(pairs=PAIRS, margin=MARGINS, which=st.integers(0, 29), by=st.floats(0.0, 1.0), less=st.floats(0.0, 0.5))
def test_a_smaller_error_or_a_smaller_margin_never_loses_the_promotion(pairs, margin, which, by, less):
    ours, theirs = map(list, zip(*pairs, strict=True))
    before = judge(ours, theirs, margin)
    ours[which % len(ours)] *= by
    after = judge(ours, theirs, max(0.0, margin - less))
    assert after.promote or not before.promote


@pytest.mark.slow
@LAWS
@given(pairs=PAIRS, order=st.randoms(use_true_random=False), extra=st.lists(ERRORS_M, max_size=5))
def test_neither_order_nor_runs_that_only_one_side_left_out_matter(pairs, order, extra):
    ours, theirs = zip(*pairs, strict=True)
    plain = judge(ours, theirs)
    store = ModelStore.open("memory://")
    mine = rows(ours) + [row(f"x{number}", error) for number, error in enumerate(extra)]
    order.shuffle(mine)
    other = compare(store, "rover", put(store, left_out=mine), put(store, test=rows(theirs)))
    assert (other.verdict, other.ratio, other.tails) == (plain.verdict, plain.ratio, plain.tails)


def test_below_a_millimetre_all_errors_are_equal():
    assert judge([FLOOR_M / 100] * 6, [FLOOR_M / 2] * 6, 0.0).ratio == 1.0


def test_a_better_average_does_not_buy_a_worse_tail():
    worse_tail = judge([0.01] * 18 + [0.6] * 3, [0.02] * 18 + [0.5] * 3)
    assert worse_tail.ratio < 0.95
    assert worse_tail.verdict is Verdict.NOT_BETTER
    assert "90th percentile of its rms error is 60.00 cm where the other has 50.00 cm" in worse_tail.sentence()
    assert judge([0.01] * 18 + [0.54] * 3, [0.02] * 18 + [0.5] * 3).promote


def test_the_tail_of_the_final_error_counts_too(store):
    ours, theirs = put(store, test=rows([0.01] * 8, final_m=0.3)), put(store, test=rows([0.02] * 8, final_m=0.2))
    judged = compare(store, "rover", ours, theirs)
    assert judged.verdict is Verdict.NOT_BETTER
    assert "final error" in judged.reason


def test_without_a_champion_the_first_version_passes(store):
    first = compare(store, "rover", put(store), None)
    assert (first.verdict, first.promote, first.against) == (Verdict.FIRST, True, None)
    assert first.sentence() == "rover@1 is the first: there is no champion to compare it with"


def test_runs_the_champion_was_trained_on_do_not_judge_it(store):
    candidate = put(store, test=rows([0.01] * 9))
    champion = put(store, test=rows([0.5] * 9)[:3], train=rows([0.5] * 9)[3:])
    judged = compare(store, "rover", candidate, champion)
    assert (judged.verdict, judged.common_runs, judged.seen_by_against) == (Verdict.NOT_COMPARABLE, 3, 6)
    assert "3 runs are unseen by both, at least 5 are needed" in judged.sentence()
    assert "rover@2 was trained on 6 of the 9 runs that rover@1 has not seen" in judged.sentence()


def test_training_runs_predicted_without_them_do_judge(store):
    errors = rows([0.5] * 9)
    candidate = put(store, test=rows([0.01] * 6), train=rows([0.01] * 9)[6:])
    champion = put(store, left_out=errors, train=errors)
    judged = compare(store, "rover", candidate, champion)
    assert (judged.verdict, judged.common_runs, judged.seen_by_against) == (Verdict.BETTER, 6, 0)
    assert (judged.seen_by_candidate, judged.ratio) == (3, pytest.approx(0.02))


def test_a_run_said_to_be_tested_and_trained_on_is_no_evidence(store):
    tested = rows([0.01] * 9)
    judged = compare(store, "rover", put(store, test=tested, train=tested[:6]), put(store, test=tested))
    assert (judged.verdict, judged.common_runs) == (Verdict.NOT_COMPARABLE, 3)


def test_a_run_trained_on_under_another_name_is_no_evidence(store):
    tested = rows([0.01] * 9)
    again = [each | {"run": f"copy of {each['run']}"} for each in tested[:6]]
    for candidate in (put(store, test=tested, train=again), put(store, left_out=tested, train=tested + again)):
        assert compare(store, "rover", candidate, put(store, test=tested)).common_runs == 3


@pytest.mark.parametrize("other", [{"slope_deg": 21.0}, {"final_x_m": 0.3}, {"run": "other"}, {"horizon_s": 20.0}])
def test_another_simulation_of_the_same_name_is_another_run(store, other):
    errors = rows([0.01] * LEAST_COMMON_RUNS)
    changed = [errors[0] | other, *errors[1:]]
    judged = compare(store, "rover", put(store, test=changed), put(store, test=errors))
    assert judged.common_runs == LEAST_COMMON_RUNS - 1
    assert judged.verdict is Verdict.NOT_COMPARABLE


def test_a_version_without_left_out_runs_is_named(store):
    tested, untested = put(store, test=rows([0.01] * 9)), put(store, train=rows([0.01] * 9))
    for pair in ((tested, untested), (untested, tested)):
        judged = compare(store, "rover", *pair)
        assert judged.verdict is Verdict.NOT_COMPARABLE
        assert "rover@2 has no errors on unseen runs" in judged.sentence()


def test_any_two_models_can_be_compared(store):
    ours, theirs = put(store, test=rows([0.01] * 9)), put(store, test=rows([0.02] * 9), name="other")
    judged = compare_versions(store, ("rover", ours), ("other", theirs))
    assert (judged.candidate, judged.against, judged.promote) == ("rover@1", "other@1", True)


@pytest.mark.parametrize("margin", [-0.01, 0.51, float("nan")])
def test_a_margin_out_of_range_is_refused(store, margin):
    with pytest.raises(InvalidValueError, match=r"margin is .*, allowed is 0 to 0\.5"):
        compare(store, "rover", put(store), None, margin=margin)


def _no_number(tested):
    return [tested[0] | {"model": {"rmse_m": "x", "final_m": 0.1, "maximum_m": 0.1}}, *tested[1:]]


def _negative(tested):
    return [tested[0] | {"model": {"rmse_m": -0.1, "final_m": 0.1, "maximum_m": 0.1}}, *tested[1:]]


@pytest.mark.parametrize("spoil", [_no_number, _negative, lambda tested: ["r0"], lambda tested: {"r0": 1}])
def test_unreadable_errors_of_the_champion_need_people_and_of_the_candidate_are_an_error(store, spoil):
    good, bad = put(store, test=rows([0.01] * 9)), put(store, test=spoil(rows([0.5] * 9)))
    judged = compare(store, "rover", good, bad)
    assert judged.verdict is Verdict.NOT_COMPARABLE
    assert "metrics.test.by_run of rover@2" in judged.reason
    with pytest.raises(CorruptArtefactError, match=r"metrics\.test\.by_run"):
        compare(store, "rover", bad, good)


def test_a_damaged_or_missing_champion_needs_people(tmp_path):
    store = ModelStore.open(tmp_path)
    good, bad = put(store, test=rows([0.01] * 9)), put(store, test=rows([0.5] * 9))
    (tmp_path / "models/rover/versions/2/report/train.json").write_bytes(b"{}")
    for against in (bad, 7):
        judged = compare(store, "rover", good, against)
        assert (judged.verdict, judged.against) == (Verdict.NOT_COMPARABLE, f"rover@{against}")
    with pytest.raises(CorruptArtefactError):
        compare(store, "rover", bad, good)
    with pytest.raises(VersionNotFoundError):
        compare(store, "rover", 7, good)


def test_the_description_is_json_with_the_verdict_and_what_it_rests_on():
    judged = judge([0.01] * 9, [0.02] * 9)
    plain = json.loads(json.dumps(judged.describe(), allow_nan=False))
    assert plain["verdict"] == "better"
    assert plain["promote"] is True
    assert plain["sentence"] == judged.sentence()
    assert plain["p90"]["rmse_m"] == {"candidate_m": 0.01, "against_m": 0.02, "ratio": 0.5}
    assert (plain["common_runs"], plain["ratio"]) == (9, pytest.approx(0.5))


def test_a_job_that_is_stopped_before_its_move_moves_nothing(tmp_path):
    class StoppedError(Exception):
        pass

    def stop():
        raise StoppedError

    store = ModelStore.open(tmp_path)
    made = promotion.JobVersion("rover", put(store, test=rows([0.01] * 9)), "job-1", "a test")
    with pytest.raises(StoppedError):
        promotion.judge(store, made, margin=0.05, promote=True, check=stop)
    assert store.aliases("rover") == {}
    assert promotion.judge(store, made, margin=0.05, promote=False, check=stop).move is None
    assert promotion.judge(store, made, margin=0.05, promote=True).move.version == made.version


def test_the_shipped_champion_beats_the_paper_s_network_on_the_runs_that_both_left_out():
    store = ModelStore.open(Path(model_store.__file__).parent)
    champion = store.resolve("viper-lunar").version
    judged = compare(store, "viper-lunar", champion, 1)
    assert (judged.verdict, judged.common_runs) == (Verdict.BETTER, 10)
    assert judged.ratio < 0.5
    assert compare(store, "viper-lunar", 1, champion).verdict is Verdict.NOT_BETTER
