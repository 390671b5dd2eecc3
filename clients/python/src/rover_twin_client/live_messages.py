"""Messages of the WebSocket, as both kinds of client send and read them. No I/O."""

from __future__ import annotations

import json
from http import HTTPStatus
from typing import Any

import httpx
from websockets.exceptions import InvalidStatus

from rover_twin_client.document import Node
from rover_twin_client.errors import ConnectionFailedError, RoverTwinError, TimedOutError, UnexpectedAnswerError
from rover_twin_client.responses import failure

CONNECT_S = 3.0
ANSWER_S = 30.0
LARGEST_BYTES = 32 << 20
_TOKENS = (HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN, HTTPStatus.TOO_MANY_REQUESTS)  # what is wrong with them


def address(base_url: httpx.URL, path: str) -> str:
    """The address of the WebSocket below the service's base address."""
    scheme = "wss" if base_url.scheme == "https" else "ws"
    return str(base_url.copy_with(scheme=scheme, path=base_url.path.rstrip("/") + path))


def packed(message: dict[str, Any]) -> str:
    """A message as text."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False)


def read(data: str | bytes) -> Node:
    """What the service sent; raises UnexpectedAnswerError for what is not JSON."""
    try:
        return Node(json.loads(data))
    except ValueError as fault:
        raise UnexpectedAnswerError("the service sent a message that is not JSON") from fault


def is_answer(node: Node) -> bool:
    """Whether a message answers what was sent; others tell that the service is about to end, and may be passed over.

    Raises what a request would when the whole message was refused.
    """
    if node.get("event") is not None:
        return False
    if (error := node.get("error")) is not None:
        raise failure(error["status"].whole(), {}, json.dumps(error.value).encode())
    return True


def broken(url: str, fault: Exception) -> RoverTwinError:
    """The error for a connection that failed, was refused or closed, or did not answer in time."""
    if isinstance(fault, TimeoutError):
        return TimedOutError(f"{url} did not answer in time")
    if isinstance(fault, InvalidStatus) and fault.response.status_code in _TOKENS and _is_problem(fault):
        return failure(fault.response.status_code, fault.response.headers, bytes(fault.response.body or b""))
    if isinstance(fault, InvalidStatus) and fault.response.status_code < HTTPStatus.INTERNAL_SERVER_ERROR:
        said = f"HTTP {fault.response.status_code}"  # another try would be refused as well
        return UnexpectedAnswerError(f"{url} takes no WebSockets ({said}): is this a rover-twin service?")
    return ConnectionFailedError(f"cannot talk to {url}: {fault or type(fault).__name__}; is the service running?")


def _is_problem(fault: InvalidStatus) -> bool:
    """Whether a service of this kind refused: others answer 403 where they know no WebSockets."""
    return fault.response.headers.get("Content-Type", "").startswith("application/problem+json")
