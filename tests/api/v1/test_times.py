"""Sampling at any rising times: the values of the trajectory there, and a summary that does not depend on them."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.api.conftest import QUESTION

RISING = "rising times from 0 to 600, the last one at least 0.0001"


def post(service, **more):
    return service.client.post("/v1/predictions", json=QUESTION | more)


@pytest.mark.slow
@given(chosen=st.sets(st.integers(0, 199), max_size=20))
@settings(max_examples=25)
def test_the_values_are_those_of_the_whole_trajectory_at_these_times(service, chosen):
    rows = [*sorted(chosen), 200]
    whole = post(service).json()
    answer = post(service, times_s=[whole["trajectory"]["time_s"][row] for row in rows]).json()

    for name, values in answer["trajectory"].items():
        assert values == pytest.approx([whole["trajectory"][name][row] for row in rows], abs=1e-12), name
    assert answer["scenario"] == whole["scenario"]
    for name in ("outcome", "final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio"):
        assert answer["summary"][name] == pytest.approx(whole["summary"][name]), name


def test_a_get_takes_them_with_commas_or_one_by_one(service):
    posted = post(service, times_s=[0.5, 1, 7.25]).content

    assert service.predict(times_s="0.5,1,7.25").content == posted
    assert service.predict(times_s=["0.5", "1", "7.25"]).content == posted
    assert post(service, times_s=[0.5, 1, 7.25], horizon_s=7.25).content == posted


@pytest.mark.slow
def test_as_many_as_there_may_be_points(serve, store, publish, move):
    move(store, publish(store))
    service = serve(max_body_bytes=4 << 20)
    most = [row * 0.005123456789 for row in range(100_000)]

    answer = post(service, times_s=most)

    assert answer.json()["trajectory"]["time_s"] == most
    refused = post(service, times_s=[*most, 600])
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["allowed"] == "at most 100000 times"


def test_the_shipped_settings_take_as_many_times_as_points():
    from service.settings import Settings

    longest = len("599.99999999999989,") * Settings.model_fields["max_points"].default

    assert Settings.model_fields["max_body_bytes"].default > longest + 4096


@pytest.mark.parametrize(
    ("more", "field", "allowed"),
    [
        ({"times_s": []}, "times_s", RISING),
        ({"times_s": [0]}, "times_s", RISING),
        ({"times_s": [1, 1]}, "times_s", RISING),
        ({"times_s": [2, 1]}, "times_s", RISING),
        ({"times_s": [-1, 1]}, "times_s", RISING),
        ({"times_s": [1, 601]}, "times_s", RISING),
        ({"times_s": ["1"]}, "times_s", RISING),
        ({"times_s": None}, "times_s", RISING),
        ({"times_s": 1}, "times_s", RISING),
        ({"times_s": [1], "dt_s": 0.5}, "dt_s", "nothing beside times_s"),
        ({"times_s": [1], "horizon_s": 2}, "horizon_s", "the last of times_s, which is 1"),
    ],
)
def test_times_that_cannot_be_are_told(service, more, field, allowed):
    answer = post(service, **more)

    assert answer.status_code == 422, answer.text
    (fault,) = answer.json()["errors"]
    assert fault["field"] == field
    assert allowed in fault["allowed"]


@pytest.mark.parametrize("text", ["", ",", "1,", "1;2", "1,x", "nan", "1,inf", "2,1", "601"])
def test_text_that_is_no_rising_times_is_told(service, text):
    (fault,) = service.predict(times_s=text).json()["errors"]

    assert (fault["field"], fault["allowed"]) == ("times_s", RISING)


@pytest.mark.slow
def test_a_body_of_many_faults_is_answered_at_once(serve, store, publish, move):
    move(store, publish(store))
    service = serve(max_body_bytes=4 << 20)

    (fault,) = post(service, times_s=["late"] * 200_000).json()["errors"]
    assert fault["field"] == "times_s"
    (fault,) = post(service, **{f"field{number}": 0 for number in range(100_000)}).json()["errors"]
    assert fault == {
        "field": "body",
        "value": "100003 members",
        "allowed": "an object with at most 1000 members",
        "message": "body is '100003 members', allowed is an object with at most 1000 members",
    }
