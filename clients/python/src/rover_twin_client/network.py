"""Timeouts, retries and named failures of the network, for both clients."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from numbers import Real
from typing import Any, TypeVar

import httpx
from tenacity import (
    BaseRetrying,
    retry_if_exception,
    stop_after_attempt,
    stop_after_delay,
    stop_all,
    wait_combine,
    wait_exception,
    wait_random_exponential,
)

from rover_twin_client.calls import Call
from rover_twin_client.errors import (
    ConnectionFailedError,
    NotReadyError,
    TimedOutError,
    UnexpectedAnswerError,
)

DEFAULT_URL = "http://127.0.0.1:8000"
# A running service accepts at once. An answer takes milliseconds, but the largest map takes seconds, and a version is
# read from its store before it answers for the first time.
DEFAULT_TIMEOUT = httpx.Timeout(connect=3.0, read=30.0, write=10.0, pool=None)
DEFAULT_RETRIES = 2
# Enough to keep a service busy, few enough for the files that a process may open. A gate in front of httpx counts them,
# so that its pool never has to wait: there a wait is a time-out, and a thousand waiting requests take minutes to sort.
DEFAULT_CONNECTIONS = 8
MOST_CONNECTIONS = 256
UNLIMITED = httpx.Limits(max_connections=None, max_keepalive_connections=MOST_CONNECTIONS)
RESTART_S = 5.0  # how long live steps try: a service that restarts answers after about two seconds
LONGEST_TIMEOUT_S = 86_400.0
LONGEST_WAIT_S = 10.0  # when the service asks for a longer wait, the call fails at once
HEADERS = {"Accept": "application/json", "User-Agent": "rover-twin-client"}
Retries = TypeVar("Retries", bound=BaseRetrying)  # tenacity's Retrying or AsyncRetrying


def checked_retries(retries: int) -> int:
    """The number of further tries; raises ValueError outside 0 to 10."""
    if isinstance(retries, bool) or not isinstance(retries, int) or not 0 <= retries <= 10:
        raise ValueError(f"retries is {retries!r}, allowed is 0 to 10")
    return retries


def checked_connections(connections: int) -> int:
    """The number of requests at once; raises ValueError outside 1 to 256."""
    if isinstance(connections, bool) or not isinstance(connections, int) or not 1 <= connections <= MOST_CONNECTIONS:
        raise ValueError(f"connections is {connections!r}, allowed is 1 to {MOST_CONNECTIONS}")
    return connections


def from_sending(timeout: float | httpx.Timeout | None) -> httpx.Timeout:
    """The limits of one request, which count from when it is sent: waiting for a connection is none of them.

    Raises ValueError for what is no time, or none that a socket can wait.
    """
    if not isinstance(timeout, httpx.Timeout):
        seconds = _seconds("timeout", timeout)
        return httpx.Timeout(connect=seconds, read=seconds, write=seconds, pool=None)
    parts = {name: _seconds(f"timeout.{name}", getattr(timeout, name)) for name in ("connect", "read", "write")}
    return httpx.Timeout(**parts, pool=None)


def _seconds(name: str, value: object) -> float | None:
    """A time in seconds; None is no limit."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, Real) or not 0 < float(value) <= LONGEST_TIMEOUT_S:
        allowed = f"more than 0 and at most {LONGEST_TIMEOUT_S:g} seconds, or an httpx.Timeout of these"
        raise ValueError(f"{name} is {value!r}, allowed is {allowed}")
    return float(value)


def checked_token(token: str | None) -> dict[str, str]:
    """The header that carries the token; raises ValueError, without the token in its text, when no header can."""
    if token is None:
        return {}
    if not isinstance(token, str) or not token.isascii() or not token.isprintable() or not token.strip():
        raise ValueError("token must be visible ASCII characters: one that the operator gave you")
    return {"Authorization": f"Bearer {token.strip()}"}


def request_of(
    http: httpx.Client | httpx.AsyncClient,
    call: Call[Any],
    files: dict[str, Any] | None,
    credentials: dict[str, str],
    timeout: httpx.Timeout,
) -> httpx.Request:
    """The HTTP request of a call; it carries `credentials`, since a service may want them with every one."""
    return http.build_request(
        call.method,
        call.path,
        params=dict(call.query),
        json=call.json,
        data=call.form,
        files=files,
        headers={**call.headers, **credentials},
        timeout=timeout,
    )


def limits_of(call: Call[Any], usual: httpx.Timeout, *, is_default: bool) -> httpx.Timeout:
    """The timeout of a call: the longer one that it needs, unless the caller chose one and the call can obey."""
    obeys = not is_default and not call.always_patient
    return usual if obeys else patient(usual, call.read_s or 0.0)


def patient(usual: httpx.Timeout, read_s: float) -> httpx.Timeout:
    """The client's timeout, but with at least `read_s` seconds between two pieces of an answer."""
    if usual.read is None or usual.read >= read_s:
        return usual
    return httpx.Timeout(connect=usual.connect, read=read_s, write=usual.write, pool=usual.pool)


def retrying(kind: type[Retries], retries: int) -> Retries:
    """Runs a function up to 1 + `retries` times, and raises the last failure as it is."""
    return kind(stop=stop_after_attempt(1 + retries), wait=WAIT, retry=WORTH_ANOTHER_TRY, reraise=True)


def bridging(kind: type[Retries], retries: int) -> Retries:
    """The same, but with any retries for at least `RESTART_S` seconds, so that a restart is bridged."""
    if retries == 0:
        return retrying(kind, 0)
    stop = stop_all(stop_after_attempt(1 + retries), stop_after_delay(RESTART_S))
    return kind(stop=stop, wait=WAIT, retry=WORTH_ANOTHER_TRY, reraise=True)


@contextmanager
def named_failures(base_url: httpx.URL) -> Iterator[None]:
    """Turns the errors of httpx into those of this client, which name the address and say what to try."""
    try:
        yield
    except httpx.ConnectTimeout as fault:
        raise TimedOutError(
            f"no connection to {base_url} in time; is the address right, and does a firewall let you through?"
        ) from fault
    except httpx.TimeoutException as fault:
        raise TimedOutError(f"{base_url} did not answer in time; try a longer `timeout`, or ask for less") from fault
    except httpx.TransportError as fault:
        raise ConnectionFailedError(f"cannot talk to {base_url}: {fault}; {_advice(base_url, fault)}") from fault
    except httpx.RequestError as fault:  # the remaining case: a body that cannot be decoded
        raise UnexpectedAnswerError(f"cannot read the answer of {base_url}: {fault}") from fault


def _advice(base_url: httpx.URL, fault: Exception) -> str:
    said = str(fault)
    if base_url.scheme == "https" and ("WRONG_VERSION_NUMBER" in said or "RECORD_LAYER_FAILURE" in said):
        return f"it does not speak https there: try {base_url.copy_with(scheme='http')}"
    if "CERTIFICATE_VERIFY_FAILED" in said:
        return "its certificate is not one that this computer trusts: the variable SSL_CERT_FILE names further ones"
    if isinstance(fault, httpx.ConnectError):
        return "is the service running? `rover-twin serve` starts one"
    return "is the service running?"


def _is_worth_another_try(fault: BaseException) -> bool:
    # Only calls that are harmless to repeat come here. A 503 without Retry-After, such as a corrupt version, does not
    # heal in seconds. After a time-out the caller has waited long enough.
    if isinstance(fault, NotReadyError):
        return fault.retry_after_s is not None and fault.retry_after_s <= LONGEST_WAIT_S
    return isinstance(fault, ConnectionFailedError)


def _asked_wait_s(fault: BaseException) -> float:
    return (fault.retry_after_s or 0.0) if isinstance(fault, NotReadyError) else 0.0


WORTH_ANOTHER_TRY = retry_if_exception(_is_worth_another_try)
# The wait that the service asked for, plus up to 0.2, 0.4, ... 1 s at random: many clients must not return at once.
WAIT = wait_combine(wait_exception(_asked_wait_s), wait_random_exponential(multiplier=0.2, max=1.0))
