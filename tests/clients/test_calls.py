"""The questions, without a network: what is asked for, and what cannot be asked at all."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_twin_client import InvalidInputError, RoverStep, calls, drive_calls
from rover_twin_client.stepping import Rovers

TRACK = {"distance_m": [0], "slope_deg": [10]}
DEFAULTS: dict[str, Any] = {"dt_s": None, "model": None, "frame": "slope", "include": (), "strict": False}


def test_a_plain_prediction_leaves_every_default_but_the_frame_to_the_service() -> None:
    call = calls.predict(28, 430, 60, 10, **DEFAULTS)

    assert call.path == "/v1/predictions"
    assert call.query == {
        "slope_deg": "28.0",
        "mass_kg": "430.0",
        "torque_nm": "60.0",
        "horizon_s": "10.0",
        "frame": "slope",
    }


def test_every_option_is_asked_for_in_the_services_own_words() -> None:
    asked = {"dt_s": 0.5, "model": "viper-lunar@3", "frame": "world", "include": ["prior", "band"], "strict": True}
    asked["band_level"] = 0.95

    query = calls.predict(1, 2, 3, 4, **asked).query

    assert query["dt_s"] == "0.5"
    assert query["model"] == "viper-lunar@3"
    assert query["frame"] == "world"
    assert query["include"] == "prior,band"
    assert query["band_level"] == "0.95"
    assert query["strict"] == "true"


def test_one_inclusion_may_be_a_bare_string() -> None:
    assert calls.predict(1, 2, 3, 4, **DEFAULTS | {"include": "prior"}).query["include"] == "prior"


@given(st.floats(allow_nan=False))
def test_numbers_keep_every_digit_even_as_numpy_scalars(value: float) -> None:
    query = calls.predict(np.float64(value), 430, 60, 10, **DEFAULTS).query

    assert float(query["slope_deg"]) == value


@pytest.mark.parametrize("value", ["heavy", None, [430], 10**400], ids=["text", "none", "list", "huge"])
def test_what_is_no_number_is_refused_by_name_before_it_is_sent(value: Any) -> None:
    with pytest.raises(InvalidInputError, match="mass_kg is ") as caught:
        calls.predict(28, value, 60, 10, **DEFAULTS)

    assert caught.value.problem is None
    assert [fault.field for fault in caught.value.faults] == ["mass_kg"]


@pytest.mark.parametrize("include", [None, [None], b"band", 5, ["band", 3]])
def test_what_are_no_words_to_include_is_refused(include: Any) -> None:
    said = r"include is .*, allowed is a list of words"
    with pytest.raises(InvalidInputError, match=said):
        calls.predict(1, 2, 3, 4, **DEFAULTS | {"include": include})
    with pytest.raises(InvalidInputError, match=said):
        drive(430, TRACK, 100, include=include)


@pytest.mark.parametrize("strict", ["no", 1, None])
def test_a_flag_is_true_or_false(strict: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"strict is .*, allowed is True or False"):
        calls.predict(1, 2, 3, 4, **DEFAULTS | {"strict": strict})
    with pytest.raises(InvalidInputError, match=r"strict is .*, allowed is True or False"):
        drive(430, TRACK, 100, strict=strict)


def test_what_to_include_may_be_told_once() -> None:
    told = DEFAULTS | {"include": (word for word in ["band"]), "band_level": 0.9}
    assert calls.predict(1, 2, 3, 4, **told).query["include"] == "band"


def test_a_number_that_went_as_text_is_a_number_in_the_fault() -> None:
    message = "slope_deg is '280.0', allowed is -90 to 90"
    fault = {"field": "slope_deg", "value": "280.0", "allowed": "-90 to 90", "message": message}
    body = json.dumps({"detail": message, "errors": [fault]}).encode()

    with pytest.raises(InvalidInputError, match=r"^slope_deg is 280\.0, allowed") as caught:
        calls.predict(280, 2, 3, 4, **DEFAULTS).read(422, {}, body)
    assert caught.value.faults[0].value == 280.0


def test_a_long_value_is_cut_in_a_message() -> None:
    with pytest.raises(InvalidInputError) as caught:
        calls.number("mass_kg", list(range(10_000)))
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("name", ["", "..", ".", "a/b", "../admin", "A", "-a", "a" * 64, "a?x=1", "é", 3])
def test_a_name_that_would_lead_to_another_address_is_refused(name: Any) -> None:
    with pytest.raises(InvalidInputError, match="name is "):
        calls.model(name)
    with pytest.raises(InvalidInputError, match="name is "):
        calls.manifest(name, 1)


@pytest.mark.parametrize("version", [0, -1, "1", 1.0, True])
def test_a_version_is_a_positive_integer(version: Any) -> None:
    with pytest.raises(InvalidInputError, match="version is "):
        calls.manifest("viper-lunar", version)


def test_readiness_is_asked_once() -> None:
    assert not calls.ready().retried
    assert calls.models().retried


def drive(mass_kg: Any, track: Any, controls: Any, **more: Any) -> Any:
    names = ("start_speed_m_s", "horizon_s", "until_distance_m", "dt_s", "times_s", "model", "band_level")
    options = dict.fromkeys(names) | {"frame": "slope", "include": (), "strict": False} | more
    return drive_calls.drive(mass_kg, track, controls, **options)


def drive_batch(drives: Any, **more: Any) -> Any:
    names = ("mass_kg", "track", "controls", "start_speed_m_s", "horizon_s", "until_distance_m", "dt_s", "times_s")
    options = dict.fromkeys((*names, "model", "band_level")) | {"frame": "slope", "include": (), "strict": False}
    return drive_calls.drive_batch(drives, **options | more)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), np.float32("nan")])
def test_what_json_cannot_hold_is_refused_by_name(value: Any) -> None:
    def refused(field: str) -> Any:
        return pytest.raises(InvalidInputError, match=f"^{field} is .*(nan|inf).*, allowed is a finite number")

    rovers = Rovers(None)
    rovers.start("a", 430, None)
    with refused("mass_kg"):
        drive(value, TRACK, 100)
    with refused("controls"):
        drive(430, TRACK, value)
    for field in ("start_speed_m_s", "horizon_s", "until_distance_m", "dt_s", "band_level"):
        with refused(field):
            drive(430, TRACK, 100, **{field: value})
        with refused(field):
            drive_batch([{"mass_kg": 430, "track": TRACK, "controls": 100}], **{field: value})
    with refused("mass_kg"):
        drive_batch([{"mass_kg": value, "track": TRACK, "controls": 100}])
    with refused("mass_kg"):
        rovers.start("b", value, None)
    with refused("start_speed_m_s"):
        rovers.start("b", 430, value)
    for field in ("slope_deg", "torque_nm", "dt_s"):
        with refused(field):
            rovers.message([RoverStep("a", **{"slope_deg": 1.0, "torque_nm": 1.0, "dt_s": 0.1, field: value})])


def test_drives_of_a_batch_share_what_stands_beside_them() -> None:
    drives = [{"mass_kg": 430}, {"mass_kg": 500, "controls": 60, "horizon_s": None}]
    body = drive_batch(drives, track=TRACK, controls=np.float64(100), horizon_s=5).json

    assert body["drives"] == [{"mass_kg": 430.0}, {"mass_kg": 500.0, "controls": 60.0}]
    assert (body["track"], body["controls"], body["horizon_s"]) == (TRACK, 100.0, 5.0)
    assert "mass_kg" not in body


@pytest.mark.parametrize(
    "own", [{"track": TRACK}, {"mass_kg": 1, "track": TRACK, "control": 1}, "fast", {"mass_kg": None}]
)
def test_a_drive_of_a_batch_that_lacks_something_is_refused(own: Any) -> None:
    with pytest.raises(InvalidInputError, match=r"drives\[1\] is "):
        drive_batch([{"mass_kg": 1, "track": TRACK}, own], controls=60)


@pytest.mark.parametrize("name", ["", "a" * 101, "\ud800", 3, None])
def test_a_rovers_id_is_a_text_that_can_be_sent(name: Any) -> None:
    for take in (lambda: Rovers(None).start(name, 430, None), lambda: Rovers(None).resume({name: "AAAA"})):
        with pytest.raises(InvalidInputError, match=r"id is .*, allowed is text of 1 to 100 characters"):
            take()


def test_the_longest_id_and_any_script_will_do() -> None:
    for name in ("a" * 100, "ровер", "🚙"):
        rovers = Rovers(None)
        rovers.start(name, 430, None)
        assert rovers.message([RoverStep(name, 10, 100)])["rovers"][0]["id"] == name


def test_a_state_is_a_text() -> None:
    with pytest.raises(InvalidInputError, match="state is 3"):
        Rovers(None).resume({"a": 3})  # type: ignore[dict-item] # what is tested


def test_only_a_braked_rover_needs_no_torque() -> None:
    rovers = Rovers(None)
    rovers.start("a", 430, None)

    with pytest.raises(InvalidInputError, match="torque_nm is None"):
        rovers.message([RoverStep("a", 10)])
    assert rovers.message([RoverStep("a", 10, brake=True)])["rovers"][0]["brake"] is True
    assert rovers.message([RoverStep("a", 10, 0)])["rovers"][0]["torque_nm"] == 0
