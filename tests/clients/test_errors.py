"""From an HTTP answer to the named error, without a network."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_twin_client import (
    ConflictError,
    ConnectionFailedError,
    DatasetRejectedError,
    InvalidInputError,
    NotAllowedError,
    NotFoundError,
    NotReadyError,
    OutsideDomainError,
    QueueFullError,
    RefusedError,
    RoverTwinError,
    ServerError,
    TimedOutError,
    UnexpectedAnswerError,
    responses,
)

NAMED = [
    ("invalid-input", 422, InvalidInputError),
    ("outside-domain", 422, OutsideDomainError),
    ("malformed-body", 400, RefusedError),
    ("unsupported-media-type", 415, RefusedError),
    ("body-too-large", 413, RefusedError),
    ("not-acceptable", 406, RefusedError),
    ("not-found", 404, NotFoundError),
    ("model-not-found", 404, NotFoundError),
    ("version-not-found", 404, NotFoundError),
    ("alias-not-found", 404, NotFoundError),
    ("method-not-allowed", 405, RefusedError),
    ("dataset-not-found", 404, NotFoundError),
    ("job-not-found", 404, NotFoundError),
    ("unauthorized", 401, NotAllowedError),
    ("admin-off", 403, NotAllowedError),
    ("insufficient-scope", 403, NotAllowedError),
    ("too-many-attempts", 429, NotAllowedError),
    ("dataset-rejected", 422, DatasetRejectedError),
    ("idempotency-key-reused", 422, InvalidInputError),
    ("dataset-in-use", 409, ConflictError),
    ("job-ended", 409, ConflictError),
    ("conflict", 409, ConflictError),
    ("precondition-failed", 412, ConflictError),
    ("precondition-required", 428, ConflictError),
    ("queue-full", 429, QueueFullError),
    ("upload-stalled", 408, RefusedError),
    ("jobs-unavailable", 503, NotReadyError),
    ("overloaded", 503, NotReadyError),
    ("artefact-corrupt", 503, NotReadyError),
    ("unsupported-format", 503, NotReadyError),
    ("store-unavailable", 503, NotReadyError),
    ("not-ready", 503, NotReadyError),
    ("internal", 500, ServerError),
]


def body(slug: str, status: int, **more: Any) -> bytes:
    problem = {"type": f"urn:rover-twin:problem:{slug}", "title": "T", "status": status, "detail": "because"}
    return json.dumps(problem | more).encode()


@pytest.mark.slow
@pytest.mark.parametrize(("slug", "status", "kind"), NAMED, ids=[slug for slug, *_ in NAMED])
def test_every_problem_of_the_service_has_its_named_error(slug: str, status: int, kind: type) -> None:
    error = responses.failure(status, {}, body(slug, status))

    assert type(error) is kind
    assert error.problem is not None
    assert error.problem.slug == slug
    assert error.problem.members["title"] == "T"
    assert str(error) == f"because (HTTP {status}, {slug})"


def test_the_tree_is_the_documented_one() -> None:
    for kind, builtin in [
        (ConnectionFailedError, ConnectionError),
        (TimedOutError, TimeoutError),
        (InvalidInputError, ValueError),
        (NotFoundError, LookupError),
    ]:
        assert issubclass(kind, builtin)
        assert issubclass(kind, RoverTwinError)
    assert issubclass(OutsideDomainError, InvalidInputError)
    assert issubclass(InvalidInputError, RefusedError)
    assert issubclass(NotReadyError, ServerError)
    assert not issubclass(UnexpectedAnswerError, ServerError)


def test_faults_keep_field_value_range_and_message() -> None:
    fault = {"field": "mass_kg", "value": -1, "allowed": "1 to 10000", "message": "mass_kg is -1"}

    error = responses.failure(422, {}, body("invalid-input", 422, errors=[fault, "nonsense", {"field": "x"}]))

    assert isinstance(error, InvalidInputError)
    first, second = error.faults
    assert (first.field, first.value, first.allowed, first.message) == tuple(fault.values())
    assert (second.field, second.allowed) == ("x", None)


@pytest.mark.parametrize(
    ("header", "seconds"), [("7", 7.0), (" 0 ", 0.0), ("Wed, 21 Oct 2026 07:28:00 GMT", None), ("-1", None)]
)
def test_retry_after_is_read_in_seconds_only(header: str, seconds: float | None) -> None:
    error = responses.failure(503, {"retry-after": header}, b"")

    assert isinstance(error, NotReadyError)
    assert error.retry_after_s == seconds


def test_a_proxys_page_is_shown_shortened() -> None:
    error = responses.failure(502, {}, b"<html>" + b"x" * 10_000)

    assert type(error) is ServerError
    assert "<html>xxx" in str(error)
    assert len(str(error)) < 300


def test_an_empty_failure_still_says_something() -> None:
    assert str(responses.failure(503, {}, b"")) == "Service Unavailable (HTTP 503, about:blank)"


@pytest.mark.parametrize("status", [201, 204, 301, 307])
def test_other_successes_and_redirects_are_unexpected(status: int) -> None:
    with pytest.raises(UnexpectedAnswerError, match=f"HTTP {status}"):
        responses.document(status, {}, b"{}")


@given(st.integers(400, 599), st.binary(max_size=60), st.text(max_size=8))
def test_any_failure_at_all_becomes_one_of_our_errors(status: int, content: bytes, header: str) -> None:
    error = responses.failure(status, {"retry-after": header}, content)

    assert isinstance(error, RefusedError if status < 500 else ServerError)
    assert error.problem is not None
    assert error.problem.status == status


@given(st.dictionaries(st.sampled_from(["type", "title", "detail", "errors", "instance"]), st.just([{}]) | st.none()))
def test_half_readable_problems_still_become_errors(members: dict[str, Any]) -> None:
    assert isinstance(responses.failure(422, {}, json.dumps(members).encode()), RefusedError)


def test_a_fault_has_the_name_of_the_argument() -> None:
    fault = {"field": "budget.max_epochs", "value": 0, "allowed": "1 to 9", "message": "budget.max_epochs is 0"}
    content = body("invalid-input", 422, errors=[fault]).replace(b"because", b"budget.max_epochs is 0")

    error = responses.failure(422, {}, content, {"budget.max_epochs": "max_epochs"})

    assert isinstance(error, InvalidInputError)
    assert str(error) == "max_epochs is 0 (HTTP 422, invalid-input)"
    assert (error.faults[0].field, error.faults[0].message) == ("max_epochs", "max_epochs is 0")
    assert error.problem is not None
    assert error.problem.faults[0].field == "budget.max_epochs"


def test_a_404_of_somebody_else_doubts_the_address() -> None:
    assert "is base_url right?" in str(responses.failure(404, {}, b'{"detail": "Not Found"}'))
    assert "base_url" not in str(responses.failure(404, {}, body("model-not-found", 404)))
