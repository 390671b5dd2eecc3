"""Swagger's *Execute* sends the first media type of an answer: JSON, where there is JSON."""

from __future__ import annotations

import pytest

from service.app import openapi_document

JSON = "application/json"
ANSWERS = [
    (f"{method} {path} {status}", list(answer.get("content", {})))
    for path, operations in openapi_document()["paths"].items()
    for method, operation in operations.items()
    for status, answer in operation["responses"].items()
]


@pytest.mark.parametrize("media", [pytest.param(media, id=name) for name, media in ANSWERS if JSON in media])
def test_json_comes_first(media):
    assert media[0] == JSON
