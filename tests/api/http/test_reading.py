"""One way to read a request: on every route of the OpenAPI document a field is known and sent once, or refused."""

from __future__ import annotations

import asyncio
import json

import httpx
import pytest
from fastapi import Request
from pydantic import BaseModel
from starlette.requests import ClientDisconnect

from service.api.http.reading import parsed, whole_body, words_of
from service.app import openapi_document
from service.wire.faults import InvalidInputError, MalformedBodyError

DOCUMENT = openapi_document()
ROUTES = [
    (method.upper(), path, operation)
    for path, methods in DOCUMENT["paths"].items()
    for method, operation in methods.items()
]
NAMES = [f"{method} {path}" for method, path, _ in ROUTES]
PLACES = {"name": "viper-lunar", "version": "1", "alias": "champion", "dataset": "0" * 64, "job_id": "0" * 36}
LISTS = {"include", "origin_m", "pivot", "slopes_deg", "times_s"}
WORDS = {"a": "words"}


def ask(running, method, path, **request) -> httpx.Response:
    headers = {"content-type": "application/json"} if method in ("POST", "PUT") else {}
    return running.client.request(method, path.format(**PLACES), headers=headers, **request)


def assert_refused(answer: httpx.Response, path: str, *said: str) -> None:
    assert answer.status_code == (400 if path.startswith("/v2") else 422), answer.text
    assert all(each in answer.json()["error"] for each in said), answer.text


@pytest.mark.parametrize(("method", "path"), [each[:2] for each in ROUTES], ids=NAMES)
def test_an_unknown_field_of_a_query_is_refused(service_with_token, method, path):
    assert_refused(ask(service_with_token, method, path, params={"bogus": "2"}), path, "bogus")


@pytest.mark.parametrize(("method", "path", "operation"), ROUTES, ids=NAMES)
def test_a_repeated_field_of_a_query_is_refused(service_with_token, method, path, operation):
    known = [each["name"] for each in operation.get("parameters", ()) if each["in"] == "query"]
    for name in [each for each in known if each not in LISTS]:
        answer = ask(service_with_token, method, path, params=[(name, "1"), (name, "2")])
        assert_refused(answer, path, name, "one value only")


BODIES = [
    (method, path, operation)
    for method, path, operation in ROUTES
    if "application/json" in operation.get("requestBody", {}).get("content", ())
]


@pytest.mark.parametrize(("method", "path"), [each[:2] for each in BODIES], ids=[f"{m} {p}" for m, p, _ in BODIES])
@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b'{"reason": "x", "reason": "y"}', 422),
        (b'{"inner": [{"a": 1, "a": 2}]}', 422),
        (b'{"inner": {"deep": {"a": 1, "a": 2}}}', 422),
        (b"{", 400),
        (b"\xff", 400),
        (b"[" * 10_000, 400),
    ],
    ids=["twice", "twice in a list", "twice within", "cut off", "no text", "deep"],
)
def test_a_body_that_can_be_read_in_two_ways_or_none_is_refused(banded, service_with_token, method, path, body, status):
    # for predictions the protocol looks for the model first
    running = banded if path.startswith("/v2/models") else service_with_token
    answer = ask(running, method, path, content=body)

    assert answer.status_code == (400 if path.startswith("/v2") else status), answer.text


@pytest.mark.parametrize(("method", "path"), [each[:2] for each in BODIES], ids=[f"{m} {p}" for m, p, _ in BODIES])
def test_an_unknown_member_of_a_body_is_refused_but_where_the_protocol_ignores_it(service_with_token, method, path):
    answer = ask(service_with_token, method, path, content=b'{"bogus": 2}')

    if path.startswith("/v2"):  # as Triton does
        assert "bogus" not in answer.text
    else:
        assert_refused(answer, path, "bogus")


def test_json_is_read_the_same_by_either_parser():
    """The quick way is taken where colons show that no name can repeat; a colon in a text sends it the other way."""
    for text in ('{"a": [1, 2.5, {"b": null}]}', '{"a": "x:y", "b": [[1], {"c": "::"}]}', "[1, true]", '"x"', "-1e3"):
        assert parsed(text.encode(), WORDS) == json.loads(text)


@pytest.mark.parametrize("text", ['{"a": 1, "a": 1}', '[[{"a": 1, "a": 2}]]', '[1, {"a": ":", "a": 2}]'])
def test_a_name_that_repeats_is_found_at_any_depth(text):
    with pytest.raises(InvalidInputError, match="one value only"):
        parsed(text.encode(), WORDS)


def test_what_is_no_json_says_why():
    for content, words in ((b"", "empty"), (b"{", "cannot be read"), (b"[" * 100_000, "too deeply")):
        with pytest.raises(MalformedBodyError, match=words):
            parsed(content, WORDS)


def test_words_are_those_of_the_model():
    class Asked(BaseModel):
        count: int
        kind: str

    assert dict(words_of(Asked)) == {"count": "a whole number", "kind": "text"}


def test_a_body_is_the_same_in_any_pieces_and_none_of_a_client_that_is_gone():
    def read(*messages):
        coming = iter(messages)

        async def receive():
            return next(coming)

        async def both():
            request = Request({"type": "http", "method": "POST", "headers": []}, receive)
            return await whole_body(request), await request.body()

        return asyncio.run(both())

    def piece(body, *, more):
        return {"type": "http.request", "body": body, "more_body": more}

    assert read(piece(b"abc", more=False)) == (b"abc", b"abc")
    assert read(piece(b"a", more=True), piece(b"", more=True), piece(b"bc", more=False)) == (b"abc", b"abc")
    assert read({"type": "http.request"}) == (b"", b"")
    with pytest.raises(ClientDisconnect):
        read(piece(b"a", more=True), {"type": "http.disconnect"})
