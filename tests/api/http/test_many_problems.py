"""A body full of mistakes: the answer names each wrong one of many, and is not larger than what an honest one gets."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from service.api.http.many_problems import problems_of
from service.wire.drives.batch import read_drives

STRANGE = {f"a{number:02d}": number for number in range(90)}
GOOD = {"slope_deg": 20, "mass_kg": 430, "torque_nm": 60}
MANY = [
    ("/v1/predictions/batch", {"scenarios": [{**GOOD, **STRANGE}] * 45}, 45),
    ("/v1/predictions/batch", {"scenarios": ["x" * 50] * 1000}, 1000),
    ("/v1/predictions/batch", {"scenarios": [{}] * 1000}, 1000),
    ("/v1/steps", {"rovers": [{"x": 1}] * 3000}, 3000),
]


@pytest.mark.parametrize(("path", "body", "count"), MANY)
def test_each_wrong_one_is_named_and_the_answer_is_bounded(service: Any, path: str, body: Any, count: int) -> None:
    answer = service.client.post(path, json=body)
    assert answer.status_code == 200, answer.text[:500]
    errors = answer.json()["errors"]
    assert [each["index"] for each in errors] == list(range(count))
    assert all(each["status"] == 422 and each["detail"] for each in errors)
    assert all(each["errors"] for each in errors[:32])
    assert not any("errors" in each for each in errors[32:])
    # the first of them in full, the others in a line
    assert len(answer.content) < 32 * 8000 + 300 * count


def test_wrong_drives_are_told_in_the_same_way() -> None:
    question = read_drives({"drives": [{"mass_kg": 430, **STRANGE}] * 200}, 100_000)
    told = problems_of(question.failures)
    assert [each["index"] for each in told] == list(range(200))
    assert len(orjson.dumps(told)) < 32 * 8000 + 300 * 200


ONE = [
    ("/v1/predictions", {**GOOD, **{f"a{number}": 1 for number in range(900)}}),
    ("/v1/predictions", {**GOOD, "include": [f"x{number}" for number in range(3000)]}),
    ("/v1/predictions", {**GOOD, "times_s": ["x"] * 10_000}),
    ("/v1/predictions/batch", {"scenarios": [GOOD], **{f"a{number}": 1 for number in range(900)}}),
    ("/v1/drives", {"mass_kg": 430, **{f"a{number}": 1 for number in range(900)}}),
    ("/v1/steps", {"rovers": [], **{f"a{number}": 1 for number in range(900)}}),
    ("/v2/models/viper-lunar/infer", {"inputs": [], **{f"a{number}": 1 for number in range(900)}}),
]


@pytest.mark.parametrize(("path", "body"), ONE)
def test_one_problem_stays_small(service: Any, path: str, body: Any) -> None:
    answer = service.client.post(path, json=body)
    assert answer.status_code in (400, 422)
    assert len(answer.content) < 32 << 10
    assert len(answer.json().get("errors", [])) <= 20


def test_few_unknown_fields_are_told_with_what_else_is_wrong(service: Any) -> None:
    answer = service.client.post("/v1/predictions/batch", json={"scenarios": [{**GOOD, "mass_kg": -1, "x": 1}, GOOD]})
    (error,) = answer.json()["errors"]
    assert {each["field"] for each in error["errors"]} == {"mass_kg", "x"}
