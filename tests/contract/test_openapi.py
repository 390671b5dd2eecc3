"""The published contract: a change of it must be seen in review, and must not be forgotten in the file.

Refresh the file with `ROVER_TWIN_REFRESH_OPENAPI=1 pytest tests/contract` (`make openapi`).
"""

from __future__ import annotations

import functools
import json
import os
from pathlib import Path

import pytest

from service.api.http.problems import PROBLEMS
from service.app import openapi_document
from service.wire.prediction import PredictionInputs
from service.wire.stage_inputs import StageInputs

published = functools.cache(openapi_document)  # half a second each time
SNAPSHOT = Path(__file__).with_name("openapi.json")


@pytest.mark.slow
def test_the_document_is_the_one_in_the_tree():
    document = published()
    if os.environ.get("ROVER_TWIN_REFRESH_OPENAPI"):
        SNAPSHOT.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n")

    assert document == json.loads(SNAPSHOT.read_text()), "the API changed: run `make openapi` and note it in CHANGELOG"


@pytest.mark.slow
def test_every_number_has_its_range_unit_and_example():
    operation = published()["paths"]["/v1/predictions"]["get"]
    parameters = {each["name"]: each for each in operation["parameters"]}

    assert set(parameters) == {*PredictionInputs.model_fields, *StageInputs.model_fields, "format"}
    numbers = ("slope_deg", "mass_kg", "torque_nm", "horizon_s", "dt_s", "band_level", "heading_deg", "meters_per_unit")
    for name in numbers:
        schema = parameters[name]["schema"]
        assert "maximum" in schema, name
        assert "minimum" in schema or "exclusiveMinimum" in schema, name
        assert schema["examples"], name
    assert all(parameter["description"] for parameter in parameters.values())


@pytest.mark.slow
def test_every_route_declares_its_problems_and_every_problem_is_declared_somewhere():
    declared = set()
    for path, operations in published()["paths"].items():
        if path.startswith("/v2"):  # the protocol has an error form of its own: tests/api/v2/test_inference_wire.py
            continue
        for operation in operations.values():
            failures = {status: each for status, each in operation["responses"].items() if status >= "4"}
            assert failures or path == "/health/live", path
            for status, response in failures.items():
                content = response["content"]
                assert list(content) == ["application/problem+json"], (path, status)
                examples = content["application/problem+json"]["examples"]
                assert all(str(each["value"]["status"]) == status for each in examples.values())
                declared |= set(examples)

    # those belong to addresses and methods that are in no document, or to what is no request yet
    nowhere = {"not-found", "method-not-allowed", "upgrade-required"}
    nowhere.add("client-gone")  # nobody is there to read it
    assert declared == set(PROBLEMS) - nowhere - {"head-too-slow"}


@pytest.mark.slow
def test_the_document_can_be_read_without_a_store():
    references = set(_references(published()))

    assert references
    assert references <= {f"#/components/schemas/{name}" for name in published()["components"]["schemas"]}


def _references(node):
    if isinstance(node, dict):
        yield from ([node["$ref"]] if isinstance(node.get("$ref"), str) else [])
        for child in node.values():
            yield from _references(child)
    elif isinstance(node, list):
        for child in node:
            yield from _references(child)
