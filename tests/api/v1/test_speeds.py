"""`include=speed` and `include=wheel_speed` over HTTP; a summary that every sampling shares."""

from __future__ import annotations

import json

import numpy as np
import pytest

from service.wire.batch_forms import BatchFormat
from service.wire.prediction import Include, PredictionInputs
from tests.api.conftest import QUESTION
from tests.api.readings import DATA_FORMS, about_in, columns_in
from tests.api.v1.test_batch import alone, ask, assert_as_alone, tables_of
from tests.digits import rounded

HORIZON_S = {"horizon_s": 4}


@pytest.mark.parametrize("form", DATA_FORMS)
@pytest.mark.parametrize("frame", ["slope", "world"])
def test_every_data_form_has_the_speed_along_the_slope(service, form, frame):
    asked = HORIZON_S | {"include": "prior,speed", "frame": frame, "format": form}
    answer = service.predict(**asked)
    columns = columns_in(form, answer.content)
    across = "y_m" if frame == "slope" else "z_m"

    names = ["time_s", "x_m", across, "speed_m_s", "prior_x_m", f"prior_{across}"]
    assert (sorted if form == "usda" else list)(columns) == (sorted(names) if form == "usda" else names)
    expected = service.predict(**HORIZON_S, include="speed").json()["trajectory"]["speed_m_s"]
    assert rounded(columns["speed_m_s"]).tolist() == expected
    if form in ("npz", "arrow", "parquet", "usda"):
        assert about_in(form, answer.content)["units"]["speed_m_s"] == "m/s"


@pytest.mark.parametrize("form", ["svg", "png"])
def test_a_plot_shows_positions_with_or_without(service, form):
    plain, moving = (service.predict(**HORIZON_S, format=form, **more) for more in ({}, {"include": "speed"}))

    assert moving.status_code == 200
    assert moving.content == plain.content


def test_it_is_a_part_that_changes_no_other(service):
    plain, moving = (service.predict(**HORIZON_S, **more).json() for more in ({}, {"include": "speed"}))
    speed = np.array(moving["trajectory"].pop("speed_m_s"))

    assert moving == plain
    assert speed.shape == np.shape(plain["trajectory"]["time_s"])
    assert speed[0] == 0


@pytest.mark.parametrize("form", BatchFormat)
@pytest.mark.parametrize("frame", ["slope", "world"])
def test_a_batch_has_it_in_every_form(service, form, frame):
    sent = [{**QUESTION, "slope_deg": slope, "horizon_s": horizon} for slope, horizon in ((5, 2), (20, 4), (31, 3))]
    shared = {"include": ["speed"], "frame": frame}
    found, errors = tables_of(ask(service, sent, form, **shared), form)

    assert errors == []
    for each, scenario in zip(found, sent, strict=True):
        assert "speed_m_s" in each
        assert_as_alone(each, alone(service, scenario, **shared))


def test_a_batch_of_which_nothing_is_left_has_the_column_all_the_same(service):
    document = ask(service, [{**QUESTION, "slope_deg": 46}], include=["speed"]).json()

    assert document["trajectory"]["speed_m_s"] == []
    assert "rear_wheel_speed_rad_s" not in document["trajectory"]


@pytest.mark.parametrize("include", ["wheel_speed", "speed,wheel_speed,prior"])
def test_a_version_that_does_not_know_its_wheels_says_so(service, include):
    answers = [service.predict(include=include, model="viper-lunar@1")]
    answers.append(ask(service, [QUESTION], include=include.split(","), model="viper-lunar@1"))

    for answer in answers:
        assert answer.status_code == 422
        (fault,) = answer.json()["errors"]
        assert (fault["field"], fault["value"]) == ("include", "wheel_speed")
        assert fault["allowed"] == "speed; viper-lunar@1 does not know how fast its wheels turn"


def test_every_part_changes_what_the_entity_tag_is_made_of():
    questions = [PredictionInputs.model_validate(QUESTION | {"include": [part]}).question() for part in Include]

    assert len({*questions, PredictionInputs.model_validate(QUESTION).question()}) == len(Include) + 1


def test_two_points_or_twenty_thousand_have_one_summary(service):
    asked = [{"dt_s": 10}, {}, {"dt_s": 0.0005}, {"times_s": "10"}, {"times_s": "0,0.1,7.77,10"}]
    asked += [{"frame": "world"}, {"include": "speed,prior"}]
    found = [service.predict(**each).json()["summary"] for each in asked]

    # the service answers by a network here: float32, whose rounding depends on what it is asked together with
    for summary in found:
        assert summary == {
            name: each if isinstance(each, str) else pytest.approx(each, rel=1e-5) for name, each in found[0].items()
        }


def test_the_wheels_are_described_in_the_document(service):
    document = json.dumps(service.client.get("/openapi.json").json())

    for name in ("speed_m_s", "rear_wheel_speed_rad_s", "front_wheel_speed_rad_s"):
        assert name in document
