"""A client generated from the OpenAPI document sends every default that the document states, wanted or not.

openapi-python-client and openapi-typescript do. So what a default would rule out must not have one.
"""

from __future__ import annotations

import pytest

from service.app import openapi_document
from tests.api.conftest import QUESTION

TIMES = [0.0, 0.5, 4.0]
DRIVE = {"mass_kg": 430, "track": {"distance_m": [0, 10], "slope_deg": [5, 5]}}
DRIVE |= {"controls": {"time_s": [0], "torque_nm": [60]}}
UPLOADS = "/v1/admin/datasets"


@pytest.fixture(scope="module")
def document():
    return openapi_document()


def defaults_of(document, path, method):
    """Of the query, and of the JSON body."""
    operation = document["paths"][path][method]
    query = {each["name"]: each["schema"].get("default") for each in operation.get("parameters", ())}
    reference = operation.get("requestBody", {}).get("content", {}).get("application/json", {}).get("schema", {})
    schema = document["components"]["schemas"][reference["$ref"].rpartition("/")[2]] if reference else {}
    body = {name: each.get("default") for name, each in schema.get("properties", {}).items()}
    return [{name: value for name, value in each.items() if value is not None} for each in (query, body)]


@pytest.mark.parametrize(
    ("path", "method", "asked"),
    [
        ("/v1/predictions", "get", QUESTION | {"times_s": TIMES}),
        ("/v1/predictions", "post", QUESTION | {"times_s": TIMES}),
        ("/v1/predictions/batch", "post", {"scenarios": [QUESTION], "times_s": TIMES}),
        ("/v1/drives", "post", DRIVE | {"times_s": TIMES}),
        ("/v1/drives/batch", "post", {"drives": [DRIVE], "times_s": TIMES}),
        ("/v1/mobility", "get", {"mass_kg": 430, "torque_min_nm": 30}),
    ],
)
def test_documented_defaults_rule_nothing_out(shipped, document, path, method, asked):
    query, body = defaults_of(document, path, method)
    if method == "get":
        answer = shipped.client.get(path, params=query | asked)
    else:
        answer = shipped.client.post(path, params=query, json=body | asked)

    assert answer.status_code == 200, answer.text
    assert not answer.json().get("errors")


def test_a_scenario_of_a_batch_has_no_default_beside_times(document):
    assert not [
        each
        for each in document["components"]["schemas"]["BatchScenario"]["properties"].values()
        if each.get("default")
    ]


def test_fields_of_an_upload_are_sent_once(service_with_token, document):
    """Each of them has two places, the query and the form: a default in both would be sent twice, which is refused."""
    operation = document["paths"][UPLOADS]["post"]
    form = operation["requestBody"]["content"]["multipart/form-data"]["schema"]["properties"]

    assert not [each["name"] for each in operation["parameters"] if "default" in each["schema"]]
    assert not [name for name, each in form.items() if "default" in each]
    assert "Without it, `default`." in form["set_name"]["description"]


def test_every_answer_in_json_has_a_type(document):
    """None of them is an object of anything, so that no generated method answers `Any`."""
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            for status, answer in operation["responses"].items():
                if schema := answer.get("content", {}).get("application/json", {}).get("schema"):
                    named = "$ref" in schema or "$ref" in schema.get("items", {})
                    assert named, (method, path, status, schema)


def test_bodies_are_there_once_by_name(document):
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            content = operation.get("requestBody", {}).get("content", {})
            if "application/json" in content:
                assert "$ref" in content["application/json"]["schema"], (method, path)
