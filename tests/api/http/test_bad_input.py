"""Every field, wrong in every way: what a client gets names the field, the value and what is allowed."""

from __future__ import annotations

import json

import pytest

NUMBERS = ("slope_deg", "mass_kg", "torque_nm", "horizon_s", "dt_s", "band_level")
RANGES = {
    "slope_deg": "-45 to 45",
    "mass_kg": "1 to 10000",
    "torque_nm": "0 to 10000",
    "horizon_s": "0.0001 to 600",
    "dt_s": "0.0001 to 60",
    "band_level": "0.5 to 0.99",
}
CHOICES = {
    "frame": "one of slope, world",
    "include": "prior",
    "strict": "true or false",
    "model": "name@version",
}
WRONG_TEXT = {
    "text": "steep",
    "empty": "",
    "nan": "NaN",
    "infinite": "inf",
    "overflowing": "1e999",
    "negative": "-1e9",
    "huge": "1" * 400,
}


def faults_in(answer, field):
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    document = answer.json()
    assert document["type"] == "urn:rover-twin:problem:invalid-input"
    assert document["status"] == 422
    assert document["detail"] == document["error"]
    assert "\n" not in document["detail"]
    found = [fault for fault in document["errors"] if fault["field"] == field]
    assert found, document
    assert all(set(fault) == {"field", "value", "allowed", "message"} and field in fault["message"] for fault in found)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG_TEXT)
@pytest.mark.parametrize("field", NUMBERS)
def test_a_wrong_number_in_a_query_is_named_with_its_range(service, field, case):
    (fault,) = faults_in(service.predict(**{field: WRONG_TEXT[case]}), field)

    assert fault["allowed"] == RANGES[field]
    assert RANGES[field] in fault["message"]
    assert len(str(fault["value"])) <= 103


@pytest.mark.parametrize(
    "literal",
    ['"28"', '"NaN"', "true", "null", "[1]", "{}", "NaN", "Infinity", "-1e9", "1e999", "1" * 400, "-" + "9" * 4000],
    ids=lambda literal: literal[:10],
)
@pytest.mark.parametrize("field", NUMBERS)
def test_a_wrong_number_in_a_body_is_named_with_its_range(service, question, field, literal):
    members = {name: json.dumps(value) for name, value in question.items()} | {field: literal}
    body = "{" + ",".join(f'"{name}":{value}' for name, value in members.items()) + "}"

    answer = service.client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})

    (fault,) = faults_in(answer, field)
    assert fault["allowed"] == RANGES[field]


@pytest.mark.parametrize("field", ["slope_deg", "mass_kg", "torque_nm"])
def test_a_missing_field_is_named(service, question, field):
    del question[field]

    for answer in (service.get("/v1/predictions", **question), service.client.post("/v1/predictions", json=question)):
        (fault,) = faults_in(answer, field)
        assert fault["value"] is None
        assert fault["allowed"] == RANGES[field]
        assert "missing" in fault["message"]


def test_everything_wrong_at_once_is_told_at_once(service):
    document = service.get("/v1/predictions", slope_deg="x", mass_kg=-1, colour="red").json()

    assert {fault["field"] for fault in document["errors"]} == {"slope_deg", "mass_kg", "torque_nm", "colour"}


def test_an_unknown_field_lists_the_known_ones(service, question):
    for answer in (
        service.predict(mass=430),
        service.client.post("/v1/predictions", json=question | {"mass": 430}),
    ):
        (fault,) = faults_in(answer, "mass")
        assert "mass_kg" in fault["allowed"]
        assert "horizon_s" in fault["allowed"]


def test_a_post_takes_its_scenario_from_the_body_only(service, question):
    answer = service.client.post("/v1/predictions", params={"slope_deg": 5}, json=question)

    faults_in(answer, "slope_deg")


WRONG_CHOICES = {
    "frame": ["", "sideways", "SLOPE", "1"],
    "include": ["", "sideways", "PRIOR", "prior;band"],
    "strict": ["", "sideways", "2"],
    "model": ["", "SLOPE", "x@0", "x@01", "x@", "@1", "../../etc/passwd", "x\n"],
}


@pytest.mark.parametrize(("field", "value"), [(field, value) for field in CHOICES for value in WRONG_CHOICES[field]])
def test_a_wrong_choice_lists_the_right_ones(service, question, field, value):
    (fault,) = faults_in(service.predict(**{field: value}), field)
    assert CHOICES[field] in fault["allowed"]
    sent = [value] if field == "include" else value
    (fault,) = faults_in(service.client.post("/v1/predictions", json=question | {field: sent}), field)
    assert CHOICES[field] in fault["allowed"]


@pytest.mark.parametrize("value", ["", "xml", "JSON"])
def test_a_wrong_format_is_one_fault_that_lists_the_right_ones(service, question, value):
    for answer in (
        service.predict(format=value),
        service.client.post("/v1/predictions", params={"format": value}, json=question),
    ):
        (fault,) = faults_in(answer, "format")
        assert fault["allowed"] == "one of json, csv, npz, arrow, parquet, usda, svg, png, html"


@pytest.mark.parametrize("field", [*NUMBERS, "model", "frame", "strict", "format"])
def test_a_field_given_twice_is_not_guessed_at(service, question, field):
    query = [*(question | {field: question.get(field, 1)}).items(), (field, 2)]

    (fault,) = faults_in(service.client.get("/v1/predictions", params=query), field)
    assert "one value" in fault["allowed"]


def test_a_member_given_twice_in_a_body_is_not_guessed_at(service):
    body = b'{"slope_deg":28,"mass_kg":430,"torque_nm":60,"mass_kg":431}'

    answer = service.client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})

    (fault,) = faults_in(answer, "mass_kg")
    assert fault["value"] == "430, 431"


@pytest.mark.slow
@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{",
        b"[" * 60_000,
        b'{"slope_deg":' + b"[" * 60_000,
        b"{'a':1}",
        b"\xff\xfe\xfd",
        b'{"slope_deg":' + b"1" * 5000 + b"}",
    ],
    ids=["empty", "cut", "deep list", "deep member", "single quotes", "no UTF-8", "5000 digits"],
)
def test_what_is_not_json_is_a_malformed_body(service, body):
    answer = service.client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})

    assert answer.status_code == 400
    assert answer.json()["type"] == "urn:rover-twin:problem:malformed-body"


@pytest.mark.parametrize("depth", [10, 100, 500, 900, 950, 970, 980, 990, 1000])
def test_nesting_of_any_depth_is_answered(service, depth):
    body = b'{"slope_deg":' + b"[" * depth + b"]" * depth + b"}"

    answer = service.client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})

    assert answer.status_code in (400, 422)


@pytest.mark.parametrize("body", [b"[]", b"1", b'"text"', b"null", b'{"\\ud800":1}', b'{"slope_deg":"\\ud800"}'])
def test_json_of_another_kind_is_invalid_input(service, body):
    answer = service.client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})

    assert answer.status_code in (400, 422), answer.text
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("kind", [None, "", "text/plain", "application/x-www-form-urlencoded", "multipart/form-data"])
def test_another_content_type_is_refused(service, kind):
    headers = {} if kind is None else {"content-type": kind}

    answer = service.client.post("/v1/predictions", content=b"{}", headers=headers)

    assert answer.status_code == 415
    assert "application/json" in answer.json()["detail"]


def test_long_values_are_cut_and_many_faults_are_bounded(service, question):
    unknown = {f"field{number}": "x" * 200 for number in range(200)}

    document = service.client.post("/v1/predictions", json=question | unknown).json()

    assert len(document["errors"]) == 20
    assert all(len(fault["value"]) == 103 for fault in document["errors"])


def test_errors_of_the_address_are_problems_too(service):
    for path, status, slug in (
        ("/nothing", 404, "not-found"),
        ("/v1/models/", 404, "not-found"),
        ("/v1/models/Nobody", 404, "model-not-found"),
        ("/v1/models/nobody", 404, "model-not-found"),
        ("/v1/models/viper-lunar/aliases/9", 404, "alias-not-found"),
        ("/v1/models/viper-lunar/aliases/nobody/history", 404, "alias-not-found"),
        ("/v1/models/viper-lunar/versions/99", 404, "version-not-found"),
        ("/v1/models/viper-lunar/versions/0", 422, "invalid-input"),
        ("/v1/models/viper-lunar/versions/01", 422, "invalid-input"),
        ("/v1/models/viper-lunar/versions/latest", 422, "invalid-input"),
        ("/v1/models/..%2f..%2fetc", 404, "not-found"),
    ):
        answer = service.get(path)
        assert (answer.status_code, answer.json()["type"]) == (status, f"urn:rover-twin:problem:{slug}"), path
        assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("path", ["", "/fmu", "/suggested-runs"])
def test_a_version_in_an_address_is_refused_with_its_range(service, path):
    for version in ("0", "1000000000", "x"):
        document = service.get(f"/v1/models/viper-lunar/versions/{version}{path}").json()
        assert document["detail"] == f"version is '{version}', allowed is a whole number from 1 to 999999999"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "methods"), [("/v1/predictions", "GET, HEAD, POST"), ("/v1/models", "GET, HEAD"), ("/v1/steps", "POST")]
)
def test_another_method_is_answered_with_those_there_are(service, path, methods):
    answer = service.client.delete(path)

    assert answer.status_code == 405
    assert answer.headers["allow"] == methods


@pytest.mark.parametrize("field", [*NUMBERS, "model", "frame", "include", "strict"])
def test_null_is_no_value(service, question, field):
    faults_in(service.client.post("/v1/predictions", json=question | {field: None}), field)


@pytest.mark.parametrize("horizon_s", ["5e-324", "1e-300", "0", "-0.0"])
def test_a_horizon_shorter_than_any_step_is_refused(service, horizon_s):
    faults_in(service.predict(horizon_s=horizon_s), "horizon_s")
