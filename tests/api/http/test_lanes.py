"""The short way and the long way to a route: the same answers, errors, headers and log names; only the way differs."""

from __future__ import annotations

import json
import threading

import httpx
import pytest
from anyio.from_thread import start_blocking_portal

import model_store
from service.api.v1 import predictions
from service.app import create_app
from service.settings import Settings

PROXY = "/behind/a/proxy"
INFER = "/v2/models/viper-lunar/infer"
OWN = {"date", "x-request-id", "content-length"}
JSON = {"content-type": "application/json"}
BODY = {"slope_deg": 28, "mass_kg": 430, "torque_nm": 60}
TENSORS = {
    "inputs": [{"name": name, "shape": [1], "datatype": "FP64", "data": [value]} for name, value in BODY.items()]
}
CASES = {
    "plain": ("GET", "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60", None),
    "csv in the world frame": (
        "GET",
        "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60&frame=world&format=csv",
        None,
    ),
    "prior and band": (
        "GET",
        "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60&include=prior,band&dt_s=2",
        None,
    ),
    "lists that repeat": (
        "GET",
        "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60&include=prior&include=band&times_s=1&times_s=2",
        None,
    ),
    "missing": ("GET", "/v1/predictions?slope_deg=28", None),
    "twice": ("GET", "/v1/predictions?slope_deg=28&slope_deg=2&mass_kg=430&torque_nm=60", None),
    "unknown": ("GET", "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60&speed=1", None),
    "blank": ("GET", "/v1/predictions?slope_deg=&mass_kg=nan&torque_nm=%ff", None),
    "strict": ("GET", "/v1/predictions?slope_deg=44&mass_kg=430&torque_nm=60&strict=true", None),
    "no such model": ("GET", "/v1/predictions?slope_deg=28&mass_kg=430&torque_nm=60&model=nobody", None),
    "other method": ("DELETE", "/v1/predictions", None),
    "posted": ("POST", "/v1/predictions?format=csv", json.dumps(BODY).encode()),
    "posted text for a number": ("POST", "/v1/predictions", json.dumps(BODY | {"slope_deg": "28"}).encode()),
    "posted NaN": ("POST", "/v1/predictions", b'{"slope_deg": NaN, "mass_kg": 430, "torque_nm": 60}'),
    "posted twice": ("POST", "/v1/predictions", b'{"slope_deg": 1, "slope_deg": 2, "mass_kg": 430, "torque_nm": 60}'),
    "posted nothing": ("POST", "/v1/predictions", b""),
    "posted a list": ("POST", "/v1/predictions", b"[1]"),
    "posted no JSON": ("POST", "/v1/predictions", b'{"slope_deg": '),
    "posted no text": ("POST", "/v1/predictions", b"\xff\xfe{}"),
    "posted deeply": ("POST", "/v1/predictions", b"[" * 20_000),
    "posted too much": ("POST", "/v1/predictions", b" " * 70_000),
    "inferred": ("POST", INFER, json.dumps(TENSORS).encode()),
    "inferred by a version": (
        "POST",
        "/v2/models/viper-lunar/versions/champion/infer",
        json.dumps(TENSORS | {"id": "7"}).encode(),
    ),
    "inferred nothing": ("POST", INFER, b""),
    "inferred with state": ("POST", INFER, json.dumps(TENSORS | {"parameters": {"sequence_id": 1}}).encode()),
    "inferred by nobody": ("POST", "/v2/models/nobody/infer", json.dumps(TENSORS).encode()),
}


class Asked:
    """The app in a running event loop, asked through ASGI as uvicorn asks it."""

    def __init__(self, portal, app, state):
        self._portal, self._app, self._state = portal, app, state
        self.loop_thread = portal.call(threading.get_ident)

    def __call__(self, method, path, content, root_path=""):
        return self._portal.call(self._ask, method, path, content, root_path)

    async def _ask(self, method, path, content, root_path):
        transport = httpx.ASGITransport(with_state(self._app, self._state), root_path=root_path)
        async with httpx.AsyncClient(transport=transport, base_url="http://twin") as client:
            headers = JSON if content is not None else {}
            return await client.request(method, root_path + path, content=content, headers=headers)


@pytest.fixture(scope="module")
def asked():
    app = create_app(Settings(store_url=next(iter(model_store.__path__)), max_body_bytes=64 * 1024))
    with (
        start_blocking_portal() as portal,
        portal.wrap_async_context_manager(app.router.lifespan_context(app)) as state,
    ):
        yield Asked(portal, app, state)


def with_state(app, state):
    """As uvicorn hands the lifespan's state to each request."""

    async def wrapped(scope, receive, send):
        await app({**scope, "state": dict(state)}, receive, send)

    return wrapped


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_both_ways_answer_the_same(asked, case):
    method, path, content = CASES[case]
    short, long = asked(method, path, content), asked(method, path, content, PROXY)

    assert short.status_code == long.status_code
    assert short.content == long.content
    for name in {*short.headers, *long.headers} - OWN:
        assert short.headers.get(name) == long.headers.get(name), name


def test_the_short_way_is_taken(asked, monkeypatch):
    """Otherwise the test above compares the long way with itself."""
    method, path, content = CASES["plain"]
    handled = []
    monkeypatch.setattr("starlette.middleware.exceptions.ExceptionMiddleware.__call__", noting(handled))

    assert asked(method, path, content).status_code == 200
    assert handled == []
    asked(method, path, content, PROXY)
    assert handled == ["long"]


def noting(handled):
    async def called(self, scope, receive, send):
        handled.append("long")
        await self.app(scope, receive, send)

    return called


@pytest.mark.slow
@pytest.mark.parametrize(
    ("query", "on_the_loop"),
    [
        ("", True),
        ("&dt_s=0.0005&format=npz", True),
        ("&dt_s=0.0005", False),
        ("&format=svg", False),
        ("&model=viper-lunar-paper", False),
    ],
)
def test_only_what_takes_microseconds_is_answered_on_the_event_loop(asked, monkeypatch, query, on_the_loop):
    """All else goes to a worker thread: the loop has other requests to answer."""
    threads, computed = [], predictions._computed

    def noted(*arguments):
        threads.append(threading.get_ident() == asked.loop_thread)
        return computed(*arguments)

    monkeypatch.setattr(predictions, "_computed", noted)
    method, path, content = CASES["plain"]
    assert asked(method, path + query, content).status_code == 200
    assert threads == [on_the_loop]
