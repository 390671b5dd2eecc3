"""Reading answers, without a network: what is understood, what is refused and by which path."""

from __future__ import annotations

import copy
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_twin_client import Prediction, UnexpectedAnswerError, parsing, responses
from rover_twin_client.document import Node

SPEEDS = ("speed_m_s", "rear_wheel_speed_rad_s", "front_wheel_speed_rad_s")


def test_a_slope_answer_becomes_arrays_and_values(slope_answer: dict[str, Any]) -> None:
    prediction = parsing.prediction(Node(slope_answer))

    assert prediction.time_s.tolist() == slope_answer["trajectory"]["time_s"]
    assert prediction.x_m.tolist() == slope_answer["trajectory"]["x_m"]
    assert prediction.y_m is not None
    assert prediction.y_m.tolist() == slope_answer["trajectory"]["y_m"]
    assert prediction.z_m is None
    assert prediction.x_m.dtype == np.float64
    assert str(prediction.model) == "viper-lunar@3"
    assert prediction.model.alias == "champion"
    assert prediction.scenario.torque_nm == 60
    assert prediction.summary.outcome == "climbs"
    assert prediction.prior is not None
    assert prediction.prior.x_m.tolist() == slope_answer["prior"]["x_m"]


def test_a_world_answer_has_z_in_place_of_y(world_answer: dict[str, Any]) -> None:
    prediction = parsing.prediction(Node(world_answer))

    assert prediction.y_m is None
    assert prediction.z_m is not None
    assert prediction.z_m.tolist() == world_answer["trajectory"]["z_m"]
    assert prediction.prior is not None
    assert prediction.prior.z_m is not None


def test_whole_numbers_become_float64_too(slope_answer: dict[str, Any]) -> None:
    slope_answer["trajectory"]["x_m"] = [0, 1, 2]

    assert parsing.prediction(Node(slope_answer)).x_m.dtype == np.float64


def test_arrays_cannot_be_changed_by_accident(slope_answer: dict[str, Any]) -> None:
    prediction = parsing.prediction(Node(slope_answer))

    with pytest.raises(ValueError, match="read-only"):
        prediction.x_m[0] = 1.0


def test_reasons_keep_open_bounds(slope_answer: dict[str, Any]) -> None:
    reason = {"field": "slope_deg", "value": 44, "lowest": None, "highest": 32, "detail": "steeper than any run"}
    slope_answer["domain"] = {"inside": False, "reasons": [reason]}

    domain = parsing.prediction(Node(slope_answer)).domain

    assert not domain.inside
    assert domain.reasons[0].lowest is None
    assert domain.reasons[0].highest == 32


def test_members_of_later_services_are_ignored(slope_answer: dict[str, Any]) -> None:
    slope_answer["energy_j"] = {"total": 0.9}
    slope_answer["domain"]["density"] = 0.41
    slope_answer["band"]["speed_m_s"] = []
    slope_answer["trajectory"]["power_w"] = []

    assert parsing.prediction(Node(slope_answer)).summary.outcome == "climbs"


def test_what_was_not_asked_for_or_does_not_apply_is_none(slope_answer: dict[str, Any]) -> None:
    del slope_answer["prior"], slope_answer["band"]
    slope_answer["summary"]["slip_ratio"] = None
    slope_answer["domain"]["nearest_runs"][0]["left_out_final_error_m"] = None
    slope_answer["model"]["alias"] = None

    prediction = parsing.prediction(Node(slope_answer))

    assert prediction.prior is None
    assert prediction.band is None
    assert prediction.domain.nearest_runs[0].left_out_final_error_m is None
    assert prediction.summary.slip_ratio is None
    assert prediction.model.alias is None


def test_the_band_becomes_arrays_with_its_level(slope_answer: dict[str, Any]) -> None:
    band = parsing.prediction(Node(slope_answer)).band

    assert band is not None
    assert band.level == 0.9
    for name in ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m"):
        assert getattr(band, name).tolist() == slope_answer["band"][name]


def test_speeds_become_arrays_where_they_were_asked_for(slope_answer: dict[str, Any]) -> None:
    plain = parsing.prediction(Node(slope_answer))
    speeds = {name: [0.0, 0.1 * at, 0.2] for at, name in enumerate(SPEEDS)}
    slope_answer["trajectory"] |= speeds
    moving = parsing.prediction(Node(slope_answer))

    for name in SPEEDS:
        assert getattr(plain, name) is None
        assert getattr(moving, name).tolist() == speeds[name]
    slope_answer["trajectory"]["speed_m_s"] = [0.0]
    with pytest.raises(UnexpectedAnswerError, match=r"trajectory\.speed_m_s"):
        parsing.prediction(Node(slope_answer))


def test_the_nearest_runs_become_values(slope_answer: dict[str, Any]) -> None:
    domain = parsing.prediction(Node(slope_answer)).domain

    assert domain.distance == 0.41
    assert [run.run for run in domain.nearest_runs] == ["s28_m430_t60"]
    assert domain.nearest_runs[0].left_out_final_error_m == 0.0074


@pytest.mark.parametrize("told", [{}, {"distance": None, "nearest_runs": []}], ids=["older service", "older version"])
def test_a_domain_that_knows_no_runs_has_none(slope_answer: dict[str, Any], told: dict[str, Any]) -> None:
    slope_answer["domain"] = {"inside": True, "reasons": [], **told}

    domain = parsing.prediction(Node(slope_answer)).domain

    assert domain.distance is None
    assert domain.nearest_runs == ()


REQUIRED = [
    "model", "model.name", "model.version", "scenario", "scenario.slope_deg", "frame", "trajectory",
    "trajectory.time_s", "trajectory.x_m", "trajectory.y_m", "domain", "domain.inside", "domain.reasons",
    "summary", "summary.outcome", "summary.final_x_m", "summary.final_y_m",
    "summary.distance_m", "prior.name", "prior.x_m", "prior.y_m",
    "band.level", "band.x_lower_m", "band.x_upper_m", "band.y_lower_m", "band.y_upper_m",
]  # fmt: skip


@pytest.mark.parametrize("path", REQUIRED)
def test_a_missing_member_is_named(slope_answer: dict[str, Any], path: str) -> None:
    *parents, last = path.split(".")
    parent = slope_answer
    for key in parents:
        parent = parent[key]
    del parent[last]

    with pytest.raises(UnexpectedAnswerError, match=f"has no member '{last}'"):
        parsing.prediction(Node(slope_answer))


UNFIT = {
    "shorter": [0.0, 1.0],
    "empty": [],
    "not a number": [0.0, float("nan"), 1.0],
    "infinite": [0.0, 1.0, float("inf")],
    "digits as text": ["0", "1", "2"],
    "truths": [True, False, True],
    "hole": [0.0, None, 1.0],
    "ragged": [[0.0], [1.0, 2.0], 3.0],
    "nested": [[0.0, 1.0, 2.0]],
    "single number": 0.0,
    "object": {"0": 1},
    "missing": None,
}


@pytest.mark.parametrize("numbers", UNFIT.values(), ids=UNFIT.keys())
def test_positions_that_do_not_fit_are_refused_by_path(slope_answer: dict[str, Any], numbers: Any) -> None:
    slope_answer["trajectory"]["x_m"] = numbers

    with pytest.raises(UnexpectedAnswerError, match=r"answer\.trajectory\.x_m"):
        parsing.prediction(Node(slope_answer))


WRONG = {
    "version text": ("model", "version", "3"),
    "version truth": ("model", "version", True),
    "name number": ("model", "name", 3),
    "inside text": ("domain", "inside", "yes"),
    "distance text": ("domain", "distance", "near"),
    "nearest runs object": ("domain", "nearest_runs", {}),
    "level text": ("band", "level", "0.9"),
    "bounds too short": ("band", "y_upper_m", [0.0]),
    "reasons object": ("domain", "reasons", {}),
    "distance nan": ("summary", "distance_m", float("nan")),
    "distance huge": ("summary", "distance_m", 10**400),
    "distance truth": ("summary", "distance_m", True),
}


@pytest.mark.parametrize(("parent", "member", "value"), WRONG.values(), ids=WRONG.keys())
def test_values_of_the_wrong_kind_are_refused_by_path(
    slope_answer: dict[str, Any], parent: str, member: str, value: Any
) -> None:
    slope_answer[parent][member] = value

    with pytest.raises(UnexpectedAnswerError, match=rf"answer\.{parent}\.{member} is .*, expected"):
        parsing.prediction(Node(slope_answer))


def test_an_unknown_frame_is_refused(slope_answer: dict[str, Any]) -> None:
    slope_answer["frame"] = "moon"

    with pytest.raises(UnexpectedAnswerError, match="frame"):
        parsing.prediction(Node(slope_answer))


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


@pytest.mark.slow
@given(data=st.data(), junk=json_values)
def test_any_member_replaced_by_anything_is_an_answer_or_a_named_error(data: st.DataObject, junk: Any) -> None:
    trajectory = {"time_s": [0.0, 1.0], "x_m": [0.0, 1.0], "y_m": [0.0, 1.0]}
    answer: Any = {
        "model": {"name": "a", "version": 1, "alias": None},
        "scenario": {"slope_deg": 1, "mass_kg": 1, "torque_nm": 1, "horizon_s": 1},
        "frame": "slope",
        "trajectory": trajectory,
        "prior": {"name": "b", "x_m": [0, 1], "y_m": [0, 1]},
        "band": {"level": 0.9} | {name: [0, 1] for name in ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")},
        "domain": {"inside": False, "reasons": [{"field": "a", "value": 1, "detail": "far"}], "nearest_runs": []},
        "summary": {"outcome": "climbs", "final_x_m": 1, "final_y_m": 0, "distance_m": 1, "mean_speed_m_s": 1},
    }
    at = copy.deepcopy(answer)
    whole = at
    while isinstance(at, dict):
        key = data.draw(st.sampled_from(sorted(at)))
        if not isinstance(at[key], dict) or data.draw(st.booleans()):
            at[key] = junk
            break
        at = at[key]

    try:
        result = parsing.prediction(Node(whole))
    except UnexpectedAnswerError:
        return
    assert isinstance(result, Prediction)
    assert result.x_m.size == result.time_s.size


@given(st.binary(max_size=40) | json_values.map(lambda value: json.dumps(value).encode()))
def test_any_body_is_an_answer_or_a_named_error(content: bytes) -> None:
    with pytest.raises(UnexpectedAnswerError):
        parsing.prediction(responses.document(200, {}, content))


def test_deeply_nested_nonsense_is_a_named_error() -> None:
    with pytest.raises(UnexpectedAnswerError, match="not JSON"):
        responses.document(200, {}, b"[" * 200_000)


def test_models_and_manifest_are_read() -> None:
    listed = {"models": [{"name": "viper-lunar", "versions": [2, 1], "aliases": {"champion": 2}}]}

    (model,) = parsing.models(Node(listed))

    assert model.versions == (1, 2)
    assert model.aliases == {"champion": 2}
    assert model.description is None
    assert parsing.manifest(Node({"name": "viper-lunar", "later": {"x": [1]}})) == {
        "name": "viper-lunar",
        "later": {"x": [1]},
    }
    with pytest.raises(UnexpectedAnswerError, match="expected an object"):
        parsing.manifest(Node([1]))
