"""Reading mobility maps and suggested runs, without a network: what is understood, and what is refused by its path."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_twin_client import MobilityMap, SuggestedRuns, UnexpectedAnswerError, parsing
from rover_twin_client.document import Node
from tests.clients.documents import mobility_document, suggested_runs_document

TABLES = ("outcome", "mean_speed_m_s", "slip_ratio", "inside_domain")


def test_a_map_becomes_tables_and_values(map_answer: dict[str, Any]) -> None:
    found = parsing.mobility(Node(map_answer))

    assert str(found.model) == "viper-lunar@3"
    assert found.model.alias == "champion"
    assert (found.mass_kg, found.horizon_s, found.confidence, found.steepest_by) == (430, 10, 0.9, "band")
    assert found.torque_nm.tolist() == [0, 40]
    assert found.slope_deg.tolist() == [10, 20, 30]
    assert found.outcome.tolist() == [["stalls"] * 3, ["climbs", "climbs", "stalls"]]
    assert found.mean_speed_m_s.tolist() == [[0, 0, 0], [0.1, 0.1, 0]]
    assert found.inside_domain.dtype == np.bool_
    assert found.mean_speed_m_s.dtype == found.slip_ratio.dtype == np.float64


def test_tables_are_compared_as_arrays_are(map_answer: dict[str, Any]) -> None:
    found = parsing.mobility(Node(map_answer))

    assert np.count_nonzero((found.outcome == "climbs") & found.inside_domain) == 2


def test_null_becomes_nan_where_it_has_a_meaning(map_answer: dict[str, Any]) -> None:
    found = parsing.mobility(Node(map_answer))

    np.testing.assert_array_equal(found.slip_ratio, [[math.nan] * 3, [0.5, 0.5, math.nan]])
    np.testing.assert_array_equal(found.steepest_climb_slope_deg, [math.nan, 20])
    assert found.steepest_inside_domain == (None, True)


def test_a_version_without_a_band_has_no_confidence(map_answer: dict[str, Any]) -> None:
    map_answer |= {"confidence": None, "steepest_by": "central_estimate", "later": [1]}

    found = parsing.mobility(Node(map_answer))

    assert (found.confidence, found.steepest_by) == (None, "central_estimate")


@pytest.mark.parametrize("name", [*TABLES, "torque_nm", "slope_deg", "steepest_climb_slope_deg"])
def test_no_array_can_be_changed_by_accident(map_answer: dict[str, Any], name: str) -> None:
    array = getattr(parsing.mobility(Node(map_answer)), name)

    with pytest.raises(ValueError, match="read-only"):
        array[0] = array[0]


def test_suggested_runs_become_values(suggestions_answer: dict[str, Any]) -> None:
    suggested = parsing.suggested_runs(Node(suggestions_answer))
    first, second = suggested.runs

    assert (str(suggested.model), suggested.model.alias) == ("viper-lunar@3", None)
    assert (first.file, first.set) == ("runs/viper_s10_m430_t60_h10.csv.gz", "suggested")
    scenario = first.slope_deg, first.mass_kg, first.torque_nm, first.horizon_s, first.step_s
    assert scenario == (10, 430, 60.5, 10, 0.001)
    assert (first.reason.expected_error_m, first.reason.distance) == (0.36, 0.92)
    assert first.reason.nearest_run == "s28_m430_t60"
    assert second.reason.expected_error_m is None


MAP_MEMBERS = [
    "model", "mass_kg", "horizon_s", "steepest_by", "torque_nm", "slope_deg", *TABLES, "steepest_climb_slope_deg",
    "steepest_inside_domain",
]  # fmt: skip


@pytest.mark.parametrize("name", MAP_MEMBERS)
def test_a_missing_member_of_a_map_is_named(map_answer: dict[str, Any], name: str) -> None:
    del map_answer[name]

    with pytest.raises(UnexpectedAnswerError, match=f"has no member '{name}'"):
        parsing.mobility(Node(map_answer))


@pytest.mark.parametrize(
    "name",
    ["file", "set", "slope_deg", "mass_kg", "torque_nm", "horizon_s", "step_s", "reason", "distance", "nearest_run"],
)
def test_a_missing_member_of_a_suggested_run_is_named(suggestions_answer: dict[str, Any], name: str) -> None:
    run = suggestions_answer["runs"][1]
    del (run if name in run else run["reason"])[name]

    with pytest.raises(UnexpectedAnswerError, match=rf"answer\.runs\[1\].* has no member '{name}'"):
        parsing.suggested_runs(Node(suggestions_answer))


UNFIT = {
    "a row too few": lambda table: table[:1],
    "a row too many": lambda table: [*table, table[0]],
    "a column too few": lambda table: [row[:-1] for row in table],
    "ragged": lambda table: [table[0], table[1][:2]],
    "flat": lambda table: table[0],
    "deeper": lambda table: [[[cell] for cell in row] for row in table],
    "turned": lambda table: [list(column) for column in zip(*table, strict=True)],
    "empty": lambda table: [],
    "object": lambda table: {"0": table[0], "1": table[1]},
    "null": lambda table: None,
}


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("spoil", UNFIT.values(), ids=UNFIT.keys())
def test_a_table_of_another_shape_is_refused_by_path(map_answer: dict[str, Any], name: str, spoil: Any) -> None:
    map_answer[name] = spoil(map_answer[name])

    with pytest.raises(UnexpectedAnswerError, match=rf"^answer\.{name}.* is .*, expected"):
        parsing.mobility(Node(map_answer))


BAD_CELLS = {
    "null outcome": ("outcome", None),
    "number as outcome": ("outcome", 1),
    "endless outcome": ("outcome", "climbs" * 10),
    "null speed": ("mean_speed_m_s", None),
    "speed nan": ("mean_speed_m_s", math.nan),
    "speed text": ("mean_speed_m_s", "0.1"),
    "slip nan": ("slip_ratio", math.nan),
    "slip infinite": ("slip_ratio", math.inf),
    "slip truth": ("slip_ratio", True),
    "inside null": ("inside_domain", None),
    "inside number": ("inside_domain", 1),
}


@pytest.mark.parametrize(("name", "value"), BAD_CELLS.values(), ids=BAD_CELLS.keys())
def test_a_bad_cell_is_refused_by_path(map_answer: dict[str, Any], name: str, value: Any) -> None:
    map_answer[name][1][2] = value

    with pytest.raises(UnexpectedAnswerError, match=rf"^answer\.{name}\[1\]\[2\] is .*, expected"):
        parsing.mobility(Node(map_answer))


WRONG = {
    "steepest too short": ("steepest_climb_slope_deg", [1.0]),
    "inside too short": ("steepest_inside_domain", [True]),
    "inside number": ("steepest_inside_domain", [True, 1]),
    "steepest text": ("steepest_climb_slope_deg", [1.0, "2"]),
    "no torques": ("torque_nm", []),
    "torque null": ("torque_nm", [0.0, None]),
    "slopes nested": ("slope_deg", [[10.0, 20.0, 30.0]]),
    "confidence text": ("confidence", "0.9"),
    "mass null": ("mass_kg", None),
    "steepest_by number": ("steepest_by", 1),
}


@pytest.mark.parametrize(("name", "value"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_member_of_a_map_is_refused_by_path(map_answer: dict[str, Any], name: str, value: Any) -> None:
    map_answer[name] = value

    with pytest.raises(UnexpectedAnswerError, match=rf"^answer\.{name}(\[1\])? is .*, expected"):
        parsing.mobility(Node(map_answer))


WRONG_RUNS = {
    "runs object": (("runs",), {}),
    "run text": (("runs", 0), "s28"),
    "slope text": (("runs", 0, "slope_deg"), "28"),
    "step nan": (("runs", 0, "step_s"), math.nan),
    "file null": (("runs", 1, "file"), None),
    "reason null": (("runs", 1, "reason"), None),
    "error text": (("runs", 1, "reason", "expected_error_m"), "0.3"),
    "version text": (("model", "version"), "3"),
}


@pytest.mark.parametrize(("path", "value"), WRONG_RUNS.values(), ids=WRONG_RUNS.keys())
def test_a_wrong_suggested_run_is_refused_by_path(
    suggestions_answer: dict[str, Any], path: tuple[str | int, ...], value: Any
) -> None:
    parent: Any = suggestions_answer
    for key in path[:-1]:
        parent = parent[key]
    parent[path[-1]] = value
    shown = "".join(rf"\[{key}\]" if isinstance(key, int) else rf"\.{key}" for key in path)

    with pytest.raises(UnexpectedAnswerError, match=f"^answer{shown} is .*, expected"):
        parsing.suggested_runs(Node(suggestions_answer))


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


def replaced_somewhere(data: st.DataObject, whole: Any, junk: Any) -> Any:
    """A copy in which one value, at any depth, is `junk`."""
    whole = at = copy.deepcopy(whole)
    while True:
        key = data.draw(st.sampled_from(sorted(at) if isinstance(at, dict) else range(len(at))))
        if not at[key] or not isinstance(at[key], dict | list) or data.draw(st.booleans()):
            at[key] = junk
            return whole
        at = at[key]


@pytest.mark.slow
@given(data=st.data(), junk=json_values)
def test_any_value_of_a_map_replaced_by_anything_is_a_map_or_a_named_error(data: st.DataObject, junk: Any) -> None:
    query = {"mass_kg": "430", "torque_min_nm": "0", "torque_max_nm": "40", "torque_steps": "2", "slope_steps": "3"}
    answer = replaced_somewhere(data, mobility_document(query), junk)

    try:
        found = parsing.mobility(Node(answer))
    except UnexpectedAnswerError:
        return
    assert isinstance(found, MobilityMap)
    shape = found.torque_nm.size, found.slope_deg.size
    assert {getattr(found, name).shape for name in TABLES} == {shape}
    assert found.steepest_climb_slope_deg.shape == shape[:1]
    assert len(found.steepest_inside_domain) == shape[0]


@pytest.mark.slow
@given(data=st.data(), junk=json_values)
def test_any_value_of_suggested_runs_replaced_by_anything_is_read_or_a_named_error(
    data: st.DataObject, junk: Any
) -> None:
    answer = replaced_somewhere(data, suggested_runs_document("viper-lunar", 3, 2), junk)

    try:
        suggested = parsing.suggested_runs(Node(answer))
    except UnexpectedAnswerError:
        return
    assert isinstance(suggested, SuggestedRuns)
