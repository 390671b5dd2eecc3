"""The map over HTTP: the twin's numbers in JSON and in CSV, and every bad query told."""

from __future__ import annotations

import csv

import pytest

from service.twin.mobility import MOST_VALUES
from service.wire.mobility import MobilityAnswer

MAP = {"mass_kg": 430, "torque_min_nm": 30, "torque_max_nm": 120, "torque_steps": 4, "slope_min_deg": 10}
SHAPE = {"slope_max_deg": 40, "slope_steps": 7, "horizon_s": 4}


def ask(service, **changes):
    asked = {name: value for name, value in (MAP | SHAPE | changes).items() if value is not None}
    return service.get("/v1/mobility", **asked)


def test_the_answer_has_the_promised_members(service):
    answer = ask(service)
    document = answer.json()

    assert answer.status_code == 200, answer.text
    assert MobilityAnswer.model_validate(document).model_dump(mode="json") == document
    assert document["model"] == {"name": "viper-lunar", "version": 1, "alias": "champion"}
    assert (document["mass_kg"], document["horizon_s"]) == (430, 4)
    assert document["torque_nm"] == [30, 60, 90, 120]
    assert document["slope_deg"] == [10, 15, 20, 25, 30, 35, 40]
    for table in ("outcome", "mean_speed_m_s", "slip_ratio", "inside_domain"):
        assert [len(row) for row in document[table]] == [7] * 4
    assert answer.headers["rover-twin-model"] == "viper-lunar@1"


def test_a_cell_is_the_prediction_of_its_scenario(service):
    document = ask(service).json()
    for row, column in ((0, 0), (1, 4), (3, 6), (2, 2)):
        torque, slope = document["torque_nm"][row], document["slope_deg"][column]
        scenario = {"slope_deg": slope, "mass_kg": 430, "torque_nm": torque, "horizon_s": 4}
        prediction = service.get("/v1/predictions", **scenario).json()

        assert document["outcome"][row][column] == prediction["summary"]["outcome"]
        assert document["mean_speed_m_s"][row][column] == pytest.approx(prediction["summary"]["mean_speed_m_s"])
        assert document["slip_ratio"][row][column] == pytest.approx(prediction["summary"]["slip_ratio"])
        assert document["inside_domain"][row][column] == prediction["domain"]["inside"]


def test_a_version_without_a_band_says_so(service):
    answer = ask(service, confidence=0.95)

    assert answer.json()["confidence"] is None
    assert answer.json()["steepest_by"] == "central_estimate"
    assert answer.headers["rover-twin-confidence"] == "none"


def test_with_a_band_the_steepest_slope_is_sure(banded):
    central = ask(banded, model="viper-lunar@2").json()
    bold, sure = ask(banded, confidence=0.75), ask(banded, confidence=0.99)

    assert (sure.json()["confidence"], sure.json()["steepest_by"]) == (0.99, "band")
    assert sure.headers["rover-twin-confidence"] == "0.99"
    assert central["steepest_by"] == "central_estimate"
    slopes = [
        [-90.0 if slope is None else slope for slope in answer.json()["steepest_climb_slope_deg"]]
        for answer in (sure, bold)
    ]
    assert all(one <= other for one, other in zip(*slopes, strict=True))
    assert slopes[0] != slopes[1]
    assert ask(banded).json()["confidence"] == 0.9


def test_csv_holds_the_very_numbers_of_json(service):
    document, table = ask(service).json(), ask(service, format="csv")
    rows = list(csv.DictReader(table.text.splitlines()))

    assert table.headers["content-type"].startswith("text/csv")
    assert len(rows) == 4 * 7
    cells = [(row, column) for row in range(4) for column in range(7)]
    for line, (row, column) in zip(rows, cells, strict=True):
        assert float(line["torque_nm"]) == document["torque_nm"][row]
        assert float(line["slope_deg"]) == document["slope_deg"][column]
        assert line["outcome"] == document["outcome"][row][column]
        assert float(line["mean_speed_m_s"]) == document["mean_speed_m_s"][row][column]
        assert number(line["slip_ratio"]) == document["slip_ratio"][row][column]
        assert line["inside_domain"] == str(document["inside_domain"][row][column]).lower()
        assert number(line["steepest_climb_slope_deg"]) == document["steepest_climb_slope_deg"][row]
        assert line["steepest_inside_domain"] == known(document["steepest_inside_domain"][row])


def number(text):
    return float(text) if text else None


def known(inside):
    return "" if inside is None else str(inside).lower()


def test_one_torque_and_one_slope_make_a_map_of_one_cell(service):
    for highest in (None, 60):
        document = ask(service, torque_min_nm=60, torque_max_nm=highest, slope_max_deg=10).json()
        assert (document["torque_nm"], document["slope_deg"]) == ([60], [10])
        assert document["outcome"] == [["climbs"]]
        assert document["steepest_climb_slope_deg"] == [10]


def test_only_the_mass_and_a_torque_are_needed(service):
    document = service.get("/v1/mobility", mass_kg=430, torque_min_nm=60).json()

    assert document["torque_nm"] == [60]
    assert document["slope_deg"] == list(range(36))
    assert document["horizon_s"] == 10


def test_the_largest_map_is_answered(service):
    document = ask(service, torque_steps=MOST_VALUES, slope_steps=MOST_VALUES, horizon_s=10).json()

    assert len(document["outcome"]) == len(document["outcome"][0]) == MOST_VALUES


@pytest.mark.parametrize(
    ("changes", "field", "allowed"),
    [
        ({"mass_kg": None}, "mass_kg", "1 to 10000"),
        ({"mass_kg": "heavy"}, "mass_kg", "1 to 10000"),
        ({"mass_kg": "nan"}, "mass_kg", "1 to 10000"),
        ({"torque_min_nm": None}, "torque_min_nm", "0 to 10000"),
        ({"torque_max_nm": -1}, "torque_max_nm", "0 to 10000"),
        ({"torque_max_nm": 29}, "torque_max_nm", "at least torque_min_nm, which is 30"),
        ({"torque_steps": MOST_VALUES + 1}, "torque_steps", "a whole number from 2 to 64"),
        ({"torque_steps": 2.5}, "torque_steps", "a whole number from 2 to 64"),
        ({"slope_steps": 1}, "slope_steps", "a whole number from 2 to 64"),
        ({"slope_max_deg": 90}, "slope_max_deg", "-45 to 45"),
        ({"slope_min_deg": 41}, "slope_max_deg", "at least slope_min_deg, which is 41"),
        ({"confidence": 0.5}, "confidence", "0.75 to 0.995"),
        ({"horizon_s": 601}, "horizon_s", "0.0001 to 600"),
        ({"model": "Viper"}, "model", "name, name@version or name@alias, with a-z, 0-9 and - in names"),
        ({"format": "xml"}, "format", "one of json, csv, svg, png, html"),
    ],
)
def test_bad_queries_name_the_field_and_what_is_allowed(service, changes, field, allowed):
    answer = ask(service, **changes)
    problem = answer.json()

    assert answer.status_code == 422
    assert problem["type"] == "urn:rover-twin:problem:invalid-input"
    assert [(each["field"], each["allowed"]) for each in problem["errors"]] == [(field, allowed)]


def test_unknown_and_repeated_fields_are_refused(service):
    unknown = ask(service, slope_deg=20)
    repeated = service.client.get("/v1/mobility", params=[*(MAP | SHAPE).items(), ("mass_kg", 500)])

    assert (unknown.status_code, repeated.status_code) == (422, 422)
    (fault,) = unknown.json()["errors"]
    assert fault["field"] == "slope_deg"
    assert "slope_max_deg" in fault["allowed"]
    assert "one value only" in repeated.json()["errors"][0]["allowed"]


def test_what_is_not_there_is_not_found(service):
    assert ask(service, model="absent").status_code == 404
    assert ask(service, model="viper-lunar@9").json()["type"].endswith("version-not-found")


def test_the_accept_header_chooses_the_form(service):
    table = service.client.get("/v1/mobility", params=MAP | SHAPE, headers={"accept": "text/csv"})
    refused = service.client.get("/v1/mobility", params=MAP | SHAPE, headers={"accept": "model/vnd.usda"})

    assert table.text == ask(service, format="csv").text
    assert refused.status_code == 406
