"""Turns an HTTP answer into a JSON document, or into the error that names what went wrong. No I/O."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping
from dataclasses import replace
from http import HTTPStatus
from typing import Any

from rover_twin_client import training_parsing
from rover_twin_client.document import Node
from rover_twin_client.errors import (
    PROBLEM_PREFIX,
    ConflictError,
    DatasetRejectedError,
    FieldFault,
    InvalidInputError,
    NotAllowedError,
    NotFoundError,
    NotReadyError,
    OutsideDomainError,
    Problem,
    QueueFullError,
    RefusedError,
    RoverTwinError,
    ServerError,
    UnexpectedAnswerError,
)
from rover_twin_client.training import UploadReport

_CONFLICTS = (HTTPStatus.CONFLICT, HTTPStatus.PRECONDITION_FAILED, HTTPStatus.PRECONDITION_REQUIRED)
SHOWN_CHARACTERS = 200  # of a foreign body: enough to recognise the page of a proxy


def document(
    status: int,
    headers: Mapping[str, str],
    content: bytes,
    statuses: Collection[int] = (HTTPStatus.OK,),
    words: Mapping[str, str] | None = None,
    numbers: Mapping[str, float] | None = None,
) -> Node:
    """The JSON document of a successful answer. `headers` must ignore the case of names.

    `words` has this client's name for fields that the service calls otherwise, `numbers` those that went as text.

    Raises UnexpectedAnswerError when the body is not JSON, and what `require` raises.
    """
    require(status, headers, content, statuses, words, numbers)
    try:
        return Node(json.loads(content))
    except (ValueError, RecursionError) as fault:
        raise UnexpectedAnswerError(f"the answer is not JSON: {_shown(content)!r}") from fault


def require(
    status: int,
    headers: Mapping[str, str],
    content: bytes,
    statuses: Collection[int],
    words: Mapping[str, str] | None = None,
    numbers: Mapping[str, float] | None = None,
) -> None:
    """Raises the named error for 4xx and 5xx, and UnexpectedAnswerError for any other status not in `statuses`."""
    if status >= HTTPStatus.BAD_REQUEST:
        raise failure(status, headers, content, words, numbers)
    if status not in statuses:
        expected = " or ".join(str(int(each)) for each in statuses)
        raise UnexpectedAnswerError(f"the service answered HTTP {status}, expected {expected}: is base_url right?")


def failure(
    status: int,
    headers: Mapping[str, str],
    content: bytes,
    words: Mapping[str, str] | None = None,
    numbers: Mapping[str, float] | None = None,
) -> RoverTwinError:
    """The error for a 4xx or 5xx answer, with its problem. A body that is not a problem becomes the `detail` of one."""
    problem = _problem(status, content)
    faults = tuple(renamed(as_number(fault, numbers or {}), words or {}) for fault in problem.faults)
    message = f"{_reason(problem, faults)} (HTTP {status}, {problem.slug})"
    if status == HTTPStatus.SERVICE_UNAVAILABLE:
        return NotReadyError(message, problem, _retry_after_s(headers))
    if status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        return ServerError(message, problem)
    if status in (HTTPStatus.NOT_FOUND, HTTPStatus.GONE):
        foreign = (
            "" if problem.type.startswith(PROBLEM_PREFIX) else "; no rover-twin service says so: is base_url right?"
        )
        return NotFoundError(message + foreign, problem)
    if status in (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN) or problem.slug == "too-many-attempts":
        return NotAllowedError(message, problem)
    if status in _CONFLICTS:
        return ConflictError(message, problem)
    if problem.slug == "queue-full":
        return QueueFullError(message, problem, _retry_after_s(headers))
    if problem.slug == "outside-domain":
        return OutsideDomainError(message, problem)
    if problem.slug == "dataset-rejected":
        return DatasetRejectedError(message, problem, _report(problem))
    if status == HTTPStatus.UNPROCESSABLE_ENTITY:
        return InvalidInputError(message, problem, faults)
    return RefusedError(message, problem)


def renamed(fault: FieldFault, words: Mapping[str, str]) -> FieldFault:
    """The fault in the names of this client's arguments."""
    name = words.get(fault.field)
    if name is None:
        return fault
    said = re.sub(rf"(?<![\w.]){re.escape(fault.field)}(?![\w.])", lambda _: name, fault.message, count=1)
    return replace(fault, field=name, message=said)


def as_number(fault: FieldFault, numbers: Mapping[str, float]) -> FieldFault:
    """The fault with the number that was given, where it went as text in an address."""
    number = numbers.get(fault.field)
    if number is None or fault.value not in (repr(number), str(number)):
        return fault
    return replace(fault, value=number, message=fault.message.replace(f"is {fault.value!r}", f"is {fault.value}", 1))


def _reason(problem: Problem, faults: tuple[FieldFault, ...]) -> str:
    """What the problem says. Where it lists its faults, these in the names of the arguments."""
    if faults != problem.faults and problem.detail == "; ".join(fault.message for fault in problem.faults):
        return "; ".join(fault.message for fault in faults)
    return problem.detail or problem.title


def _problem(status: int, content: bytes) -> Problem:
    """Reads what it can: half an explanation of a failure is better than a second failure."""
    members = _members(content)
    faults = members.get("errors")
    return Problem(
        type=str(members.get("type", "about:blank")),
        title=str(members.get("title", _phrase(status))),
        status=status,
        detail=str(members.get("detail", "" if members else _shown(content))),
        instance=str(members["instance"]) if members.get("instance") is not None else None,
        faults=tuple(_fault(fault) for fault in faults if isinstance(fault, dict)) if isinstance(faults, list) else (),
        members=members,
    )


def _report(problem: Problem) -> UploadReport | None:
    try:
        return training_parsing.report(Node(problem.members)["report"])
    except UnexpectedAnswerError:
        return None


def _members(content: bytes) -> dict[str, Any]:
    try:
        answer = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    return answer if isinstance(answer, dict) else {}


def _fault(members: Mapping[str, Any]) -> FieldFault:
    allowed = members.get("allowed")
    return FieldFault(
        field=str(members.get("field", "")),
        value=members.get("value"),
        allowed=None if allowed is None else str(allowed),
        message=str(members.get("message", "")),
    )


def _phrase(status: int) -> str:
    try:
        return HTTPStatus(status).phrase
    except ValueError:
        return f"HTTP {status}"


def _retry_after_s(headers: Mapping[str, str]) -> float | None:
    """The seconds of a Retry-After header. A date is ignored, because the two clocks may differ."""
    value = headers.get("retry-after", "").strip()
    return float(value) if value.isascii() and value.isdigit() else None


def _shown(content: bytes) -> str:
    return content[:SHOWN_CHARACTERS].decode("utf-8", errors="replace").strip()
