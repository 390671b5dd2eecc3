"""Many scenarios as questions, without a network: what is asked for, and what is refused before it is sent."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_twin_client import InvalidInputError, UnexpectedAnswerError, calls
from rover_twin_client.batch import parsing as batch_parsing
from rover_twin_client.batch.calls import PIECE_SCENARIOS, BatchQuestion, BatchWork, question
from rover_twin_client.document import Node

SHARED: dict[str, Any] = {
    **dict.fromkeys(("dt_s", "times_s", "model", "band_level")),
    "frame": "slope",
    "include": (),
    "strict": False,
}


def asked(scenarios: Any = None, *, shared: dict[str, Any] | None = None, **own: Any) -> BatchQuestion:
    return question(scenarios, own, **SHARED | (shared or {}))


def body(found: BatchQuestion) -> dict[str, Any]:
    json_body = found.call(0, found.count, None).json
    assert json_body is not None
    return dict(json_body)


def test_a_number_holds_for_all_and_an_array_has_one_for_each() -> None:
    found = body(asked(slope_deg=np.array([1, 2]), mass_kg=430, torque_nm=range(60, 62)))

    assert found["scenarios"] == [
        {"slope_deg": 1.0, "mass_kg": 430.0, "torque_nm": 60.0},
        {"slope_deg": 2.0, "mass_kg": 430.0, "torque_nm": 61.0},
    ]


def test_rows_share_what_is_given_beside_them() -> None:
    found = body(asked([{"slope_deg": 1}, {"slope_deg": 2, "horizon_s": 5}], mass_kg=430, torque_nm=60))

    assert [each.get("horizon_s") for each in found["scenarios"]] == [None, 5.0]
    assert {each["mass_kg"] for each in found["scenarios"]} == {430.0}


@pytest.mark.parametrize(
    ("scenarios", "own", "said"),
    [
        (None, {}, "slope_deg is None, allowed is a number for all scenarios"),
        ([], {}, r"scenarios is \[\], allowed is one or more scenarios"),
        ("fast", {}, "scenarios is 'fast'"),
        ([3], {}, r"scenarios\[0\] is 3, allowed is a mapping"),
        ([{"slope": 3}], {}, r"scenarios\[0\] is 'slope', allowed is fields slope_deg"),
        ([{"slope_deg": "steep"}], {}, r"scenarios\[0\].slope_deg is 'steep', allowed is a number"),
        (None, {"slope_deg": 1, "mass_kg": "x", "torque_nm": 1}, "mass_kg is 'x', allowed is a number"),
        (None, {"slope_deg": 1, "mass_kg": 1, "torque_nm": 1, "horizon_s": np.nan}, "horizon_s is nan, allowed is"),
        ({"slope": [3]}, {}, "scenarios is 'a table with a column slope'"),
        ([{"mass_kg": 1}], {"mass_kg": 2}, "mass_kg is 'given twice'"),
        (
            None,
            {"slope_deg": [1, 2], "mass_kg": [1, 2, 3], "torque_nm": 1},
            "mass_kg is '3 numbers'.*2 as in slope_deg",
        ),
        (None, {"slope_deg": [[1]], "mass_kg": 1, "torque_nm": 1}, "slope_deg is 'an array of shape"),
        (None, {"slope_deg": [], "mass_kg": 1, "torque_nm": 1}, "scenarios is 'none'"),
    ],
)
def test_what_are_no_scenarios_is_refused_by_name(scenarios: Any, own: dict[str, Any], said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        asked(scenarios, **own)


GOOD = {"slope_deg": 1, "mass_kg": 2, "torque_nm": 3}
UNREADABLE = {
    "scenarios[1].torque_nm is 'x', allowed is a number": {**GOOD, "torque_nm": "x"},
    "scenarios[1].mass_kg is [2], allowed is a number": {**GOOD, "mass_kg": [2]},
    "scenarios[1].horizon_s is nan, allowed is a number of seconds": {**GOOD, "horizon_s": np.nan},
    "scenarios[1] is 'slope', allowed is fields": {**GOOD, "slope": 1},
    "scenarios[1] is 7, allowed is a mapping": 7,
}


@pytest.mark.parametrize(("said", "bad"), UNREADABLE.items(), ids=list(UNREADABLE))
def test_a_scenario_that_cannot_be_read_is_a_failure_at_its_place(said: str, bad: Any) -> None:
    found = asked([GOOD, bad, {**GOOD, "horizon_s": None}])
    work = BatchWork(found, lambda _: None)
    span = work.take()
    assert span == (0, 3)
    assert body(found)["scenarios"][1]["slope_deg"] is None  # which the service refuses
    assert body(found)["scenarios"][2] == GOOD
    work.answered(span, batch_parsing.piece(Node(answer(3, [1]))))
    batch = batch_parsing.batch(found.columns, work.pieces, found.unreadable)

    (failure,) = batch.failures
    assert failure.index == 1
    assert failure.detail.startswith(said)
    assert failure.faults[0].field == said.split(" is ")[0]


def test_columns_and_tables_have_the_same_failures() -> None:
    import pandas as pd
    import polars as pl

    columns: dict[str, Any] = {"slope_deg": [1.0, 1.0, 1.0], "mass_kg": 2, "torque_nm": 3}
    for horizons in ([5.0, np.nan, None], pl.Series([5.0, np.nan, None], strict=False), np.array([5, np.nan, 5])):
        assert list(asked(**columns, horizon_s=horizons).unreadable) == [1]
    table = pd.DataFrame({**columns, "torque_nm": [3, "x", 3]})
    assert [each.detail for each in asked(table).unreadable.values()] == [
        "scenarios[1].torque_nm is 'x', allowed is a number"
    ]


def test_a_table_with_a_column_too_many_hears_its_name_in_one_sentence() -> None:
    import pandas as pd

    table = pd.DataFrame({name: [value] * 2 for name, value in GOOD.items()} | {"site": ["A", "B"]})
    with pytest.raises(InvalidInputError, match="with a column site', allowed is columns slope_deg, mass_kg") as caught:
        asked(table)
    assert len(str(caught.value)) < 150


def test_the_table_of_a_batch_is_a_question_again() -> None:
    found = asked([GOOD] * 3)
    work = BatchWork(found, lambda _: None)
    span = work.take()
    assert span is not None
    work.answered(span, batch_parsing.piece(Node(answer(3, []))))
    batch = batch_parsing.batch(found.columns, work.pieces)

    for table in (batch.to_pandas(), batch.to_polars()):
        assert asked(table).columns["slope_deg"].tolist() == [1, 1, 1]
    for word in ("to_pandas", "to_polars"):
        with pytest.raises(InvalidInputError, match="per is 'x', allowed is 'scenario' or 'time'"):
            getattr(batch, word)(per="x")


def test_a_level_without_a_band_is_refused_wherever_it_is_said() -> None:
    said = r"band_level is 0.5, allowed is nothing without include=\[\"band\"\]"
    with pytest.raises(InvalidInputError, match=said):
        asked(slope_deg=1, mass_kg=1, torque_nm=1, shared={"band_level": 0.5, "include": ["prior"]})
    with pytest.raises(InvalidInputError, match=said):
        calls.predict(1, 2, 3, 4, dt_s=None, model=None, frame="slope", include=(), strict=False, band_level=0.5)


def answer(count: int, refused: list[int]) -> bytes:
    """What the service writes for so many scenarios, in the words of its contract."""
    import io

    rows = [each for each in range(count) if each not in refused]
    arrays: dict[str, Any] = {name: np.zeros((len(rows), 2)) for name in ("x_m", "y_m")}
    for name in ("horizon_s", "final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio", "distance"):
        arrays[name] = np.zeros(len(rows))
    flags = {name: np.ones(len(rows), dtype=bool) for name in ("inside", "slip_ratio_known")}
    words = {name: np.full(len(rows), "climbs") for name in ("outcome", "outside_of", "nearest_run")}
    errors = [{"index": each, "detail": "no", "errors": []} for each in refused]
    about = {"model": {"name": "viper-lunar", "version": 3, "alias": None}, "frame": "slope", "errors": errors}
    file = io.BytesIO()
    places = {"index": np.array(rows, dtype=int), "points": np.full(len(rows), 2), "time_s": np.array([0.0, 1.0])}
    np.savez(file, **arrays, **flags, **words, **places, metadata=np.array(json.dumps(about)))
    return file.getvalue()


@given(count=st.integers(1, 4 * PIECE_SCENARIOS), bad=st.sets(st.integers(0, 4 * PIECE_SCENARIOS), max_size=5))
def test_every_scenario_is_asked_for_once_and_stands_at_its_place(count: int, bad: set[int]) -> None:
    found = asked(slope_deg=np.arange(count), mass_kg=430, torque_nm=60, shared={"times_s": [0, 1]})
    told: list[int] = []
    work = BatchWork(found, told.append)
    while (span := work.take()) is not None:
        start, stop = span
        call = work.call(span)
        assert call.json is not None
        assert [each["slope_deg"] for each in call.json["scenarios"]] == list(range(start, stop))
        assert ("model" in call.json) == (start > 0)
        content = answer(stop - start, [each - start for each in sorted(bad) if start <= each < stop])
        work.answered(span, call.read(200, {}, content))
    batch = batch_parsing.batch(found.columns, work.pieces)

    assert sum(told) == len(batch) == count
    assert [failure.index for failure in batch.failures] == [each for each in sorted(bad) if each < count]
    assert np.flatnonzero(batch.outcome == "").tolist() == [failure.index for failure in batch.failures]
    assert np.isnan(batch.x_m).all(axis=1).tolist() == (batch.outcome == "").tolist()


@pytest.mark.parametrize("content", [b"", b"PK", b"<html>", b"\x93NUMPY", answer(2, [])[:-40]])
def test_what_is_no_archive_is_an_unexpected_answer(content: bytes) -> None:
    with pytest.raises(UnexpectedAnswerError):
        batch_parsing.piece(Node(content))


def test_an_answer_to_fewer_scenarios_is_an_unexpected_one() -> None:
    work = BatchWork(asked(slope_deg=[1, 2, 3], mass_kg=1, torque_nm=1), lambda _: None)
    span = work.take()
    assert span == (0, 3)
    with pytest.raises(UnexpectedAnswerError, match="3 scenarios were sent, the answer is to 2"):
        work.answered(span, batch_parsing.piece(Node(answer(2, []))))
