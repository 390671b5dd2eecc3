"""The band and the nearest runs over HTTP."""

from __future__ import annotations

import numpy as np
import pytest

BOUNDS = ["x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m"]
ASKED = {"slope_deg": 12, "mass_kg": 430, "torque_nm": 60, "horizon_s": 4}


def fault_of(answer):
    assert answer.status_code == 422, answer.text
    problem = answer.json()
    assert problem["type"] == "urn:rover-twin:problem:invalid-input"
    (fault,) = problem["errors"]
    assert fault["message"] == problem["detail"]
    return fault


def test_a_band_comes_when_asked_for_and_holds_the_trajectory(banded):
    plain = banded.predict(**ASKED).json()
    answer = banded.predict(**ASKED, include="prior,band", band_level=0.8).json()

    assert "band" not in plain
    assert list(answer) == ["model", "scenario", "frame", "trajectory", "prior", "band", "domain", "summary"]
    assert list(answer["band"]) == ["level", *BOUNDS]
    assert answer["band"]["level"] == 0.8
    assert {**answer, "prior": None, "band": None} == {**plain, "prior": None, "band": None}
    for name in ("x", "y"):
        lower, centre, upper = (
            np.array(values)
            for values in (
                answer["band"][f"{name}_lower_m"],
                answer["trajectory"][f"{name}_m"],
                answer["band"][f"{name}_upper_m"],
            )
        )
        assert (lower <= centre).all()
        assert (centre <= upper).all()
        assert upper[-1] - lower[-1] > upper[0] - lower[0]


def test_the_usual_level_is_nine_tenths_and_a_higher_one_is_wider(banded):
    usual, same, higher = (
        banded.predict(**ASKED, include="band", **level).json()["band"]
        for level in ({}, {"band_level": 0.9}, {"band_level": 0.95})
    )

    assert usual == same
    assert higher["x_upper_m"][-1] > usual["x_upper_m"][-1]


def test_a_post_answers_the_same_band(banded):
    sent = {**ASKED, "include": ["band"], "band_level": 0.75}

    assert banded.client.post("/v1/predictions", json=sent).content == banded.predict(**sent).content


@pytest.mark.parametrize("include", ["band", "prior,band", "band,prior"])
def test_csv_holds_the_very_numbers_of_json(banded, include):
    document = banded.predict(**ASKED, include=include).json()
    table = banded.predict(**ASKED, include=include, format="csv")

    header, *rows = table.text.splitlines()
    columns = dict(zip(header.split(","), np.array([row.split(",") for row in rows], dtype=float).T, strict=True))
    assert list(columns)[-4:] == BOUNDS
    for name in BOUNDS:
        assert columns[name].tolist() == document["band"][name]
    assert table.headers["rover-twin-band-level"] == "0.9"
    assert "rover-twin-band-level" not in banded.predict(**ASKED).headers


def test_a_version_without_a_band_refuses_to_make_one_up(banded):
    fault = fault_of(banded.predict(**ASKED, include="prior,band", model="viper-lunar@2"))

    assert fault["field"] == "include"
    assert fault["value"] == "band"
    assert fault["allowed"] == "prior or speed; viper-lunar@2 was published without a band"
    assert banded.predict(**ASKED, include="prior", band_level=0.95, model="viper-lunar@2").status_code == 200


def test_a_band_in_the_world_frame_is_refused(banded):
    fault = fault_of(banded.predict(**ASKED, include="band", frame="world"))

    assert (fault["field"], fault["value"]) == ("frame", "world")
    assert fault["allowed"].startswith("slope where a band is asked for")


@pytest.mark.parametrize("level", ["0.49", "0.995", "1", "90", "NaN", "high", ""])
def test_a_level_that_is_not_offered_is_named_with_its_range(banded, level):
    fault = fault_of(banded.predict(**ASKED, include="band", band_level=level))

    assert fault["field"] == "band_level"
    assert fault["allowed"] == "0.5 to 0.99"


def test_the_domain_tells_how_near_the_nearest_runs_are(banded):
    domain = banded.predict(**ASKED).json()["domain"]

    assert domain["inside"]
    assert len(domain["nearest_runs"]) == 3
    distances = [run["distance"] for run in domain["nearest_runs"]]
    assert distances == sorted(distances)
    assert domain["distance"] == distances[0]
    assert set(domain["nearest_runs"][0]) == {
        "run", "slope_deg", "mass_kg", "torque_nm", "left_out_final_error_m", "distance"
    }  # fmt: skip


def test_far_from_every_run_is_outside_jointly_too(banded):
    answer = banded.predict(**(ASKED | {"mass_kg": 9000}))
    refusal = banded.predict(**(ASKED | {"mass_kg": 9000}), strict="true").json()

    domain = answer.json()["domain"]
    joint = domain["reasons"][-1]
    assert joint["field"] == "joint"
    assert joint["value"] == domain["distance"] > joint["highest"]
    assert refusal["domain"] == domain
    assert refusal["errors"][-1]["field"] == "joint"
