"""A small real HTTP server that speaks the service's contract, and misbehaves on request.

The client's base address picks the behaviour: `<url>` answers as the service does, `<url>/<behaviour>` answers
every question in that one way. So every failure reaches the client through real sockets.
"""

from __future__ import annotations

import asyncio
import math
import socket
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

from rover_twin_client import AsyncRoverTwin, RoverTwin
from tests.clients.documents import mobility_document, prediction_document, suggested_runs_document

Ask = Callable[..., Any]


def problem(slug: str, status: int, detail: str, headers: dict[str, str] | None = None, **more: Any) -> Response:
    document = {"type": f"urn:rover-twin:problem:{slug}", "title": slug.replace("-", " "), "status": status}
    document |= {"detail": detail, "instance": "/v1/predictions", "error": detail, **more}
    return JSONResponse(document, status, headers, media_type="application/problem+json")


def refusal(query: dict[str, str]) -> Response | None:
    mass_kg = float(query["mass_kg"])
    if not (math.isfinite(mass_kg) and 1 <= mass_kg <= 10000):
        message = f"mass_kg is {query['mass_kg']}, allowed is 1 to 10000"
        fault = {"field": "mass_kg", "value": query["mass_kg"], "allowed": "1 to 10000", "message": message}
        return problem("invalid-input", 422, message, errors=[fault])
    if query.get("model", "viper-lunar").split("@")[0] != "viper-lunar":
        return problem("model-not-found", 404, f"there is no model {query['model']!r}")
    if query.get("strict") == "true" and float(query["slope_deg"]) > 40:
        return problem("outside-domain", 422, 'slope_deg is outside the "validated" domain', errors=[])
    return None


def predictions(request: Request) -> Response:
    query = dict(request.query_params)
    if (refused := refusal(query)) is not None:
        return refused
    answer = prediction_document(query)
    if query.get("format") == "csv":
        rows = zip(*answer["trajectory"].values(), strict=True)
        lines = [",".join(answer["trajectory"]), *(",".join(map(str, row)) for row in rows)]
        return PlainTextResponse("\n".join(lines) + "\n", media_type="text/csv")
    return JSONResponse(answer)


VIPER = {"name": "viper-lunar", "versions": [1, 2, 3], "aliases": {"champion": 3}}


def models(request: Request) -> Response:
    return JSONResponse({"models": [VIPER]})


def model(request: Request) -> Response:
    if request.path_params["name"] != "viper-lunar":
        return problem("model-not-found", 404, "there is no such model")
    return JSONResponse(VIPER | {"description": "VIPER on lunar regolith"})


def manifest(request: Request) -> Response:
    if request.path_params["version"] != 3:
        return problem("version-not-found", 404, "there is no such version")
    return JSONResponse({"format": "rover-twin-manifest", "name": "viper-lunar", "version": 3, "files": {}})


def mobility(request: Request) -> Response:
    return JSONResponse(mobility_document(dict(request.query_params)))


def suggested_runs(request: Request) -> Response:
    count = int(request.query_params.get("n", "8"))
    return JSONResponse(suggested_runs_document(request.path_params["name"], request.path_params["version"], count))


def ready(request: Request) -> Response:
    identity = {"name": "viper-lunar", "version": 3, "alias": "champion"}
    return JSONResponse({"status": "ready", "model": identity, "probe": {}, "failures": []})


def busy(seconds: int) -> Response:
    return problem("not-ready", 503, "loading the model", {"Retry-After": str(seconds)})


# Behaviours that are one and the same answer each time.
MISBEHAVIOURS: dict[str, Callable[[], Response]] = {
    "busy": lambda: busy(0),
    "busy-for-long": lambda: busy(3600),
    "corrupt": lambda: problem("artefact-corrupt", 503, "weights.safetensors does not match its digest"),
    "broken": lambda: problem("internal", 500, "an error without a name"),
    "proxy-page": lambda: PlainTextResponse("<html>Bad Gateway</html>", 502),
    "throttled": lambda: problem("too-many", 429, "slow down"),
    "redirect": lambda: RedirectResponse("/elsewhere"),
    "website": lambda: PlainTextResponse("<html>welcome</html>"),
    "other-api": lambda: JSONResponse({"hello": "world"}),
    "bad-gzip": lambda: Response(b"not gzip", headers={"Content-Encoding": "gzip"}),
}


class Misbehaviour:
    """Counts the questions of each behaviour; `busy-once` recovers at the second, `slow` takes four seconds."""

    def __init__(self, hits: Counter[str]) -> None:
        self.hits = hits

    def instead_of(self, right: Callable[[Request], Response]) -> Callable[[Request], Awaitable[Response]]:
        """Misbehaves in the way that the address names, where a service that behaves answers `right`."""

        async def answer(request: Request) -> Response:
            kind = request.path_params["kind"]
            self.hits[kind] += 1
            if kind == "busy-once":
                return busy(0) if self.hits[kind] == 1 else right(request)
            if kind == "slow":
                await asyncio.sleep(4.0)
                return right(request)
            return MISBEHAVIOURS[kind]()

        return answer


@dataclass
class ContractService:
    url: str
    hits: Counter[str] = field(default_factory=Counter)


@pytest.fixture(scope="session")
def contract_service() -> Iterator[ContractService]:
    """The server, on a free port of the loopback interface, for the whole session."""
    hits: Counter[str] = Counter()
    misbehaviour = Misbehaviour(hits)
    answers = {
        "/v1/predictions": predictions,
        "/v1/mobility": mobility,
        "/v1/models": models,
        "/v1/models/{name}": model,
        "/v1/models/{name}/versions/{version:int}": manifest,
        "/v1/models/{name}/versions/{version:int}/suggested-runs": suggested_runs,
        "/health/ready": ready,
    }
    behaving = [Route(path, answer) for path, answer in answers.items()]
    misbehaving = [Route(f"/{{kind}}{path}", misbehaviour.instead_of(answer)) for path, answer in answers.items()]
    app = Starlette(routes=behaving + misbehaving)
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning", ws="none", lifespan="off"))
    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        deadline = time.monotonic() + 10
        while not server.started and time.monotonic() < deadline:
            time.sleep(0.01)
        assert server.started
        yield ContractService(f"http://127.0.0.1:{listener.getsockname()[1]}", hits)
        server.should_exit = True
        thread.join(timeout=10)


@pytest.fixture
def fresh_hits(contract_service: ContractService) -> Counter[str]:
    """Questions seen by each behaviour since this test began."""
    contract_service.hits.clear()
    return contract_service.hits


def seen(hits: Counter[str], behaviour: str, questions: int) -> int:
    """How often it was asked for; a question whose asker gave up may still be on its way."""
    deadline = time.monotonic() + 10
    while hits[behaviour] < questions and time.monotonic() < deadline:
        time.sleep(0.01)
    return hits[behaviour]


@pytest.fixture
def slope_answer() -> dict[str, Any]:
    """A whole answer in the slope frame, prior included."""
    query = {"slope_deg": "28", "mass_kg": "430", "torque_nm": "60", "horizon_s": "10", "include": "prior,band"}
    return prediction_document(query)


@pytest.fixture
def world_answer() -> dict[str, Any]:
    """The same in the world frame, which has z_m in place of y_m."""
    query = {"slope_deg": "28", "mass_kg": "430", "torque_nm": "60", "horizon_s": "10", "include": "prior"}
    return prediction_document(query | {"frame": "world"})


def ask_sync(url: str, word: str, *args: Any, settings: dict[str, Any] | None = None, **options: Any) -> Any:
    with RoverTwin(url, **settings or {}) as twin:
        answer = getattr(twin, word)(*args, **options)
        return list(answer) if isinstance(answer, Iterator) else answer


def ask_async(url: str, word: str, *args: Any, settings: dict[str, Any] | None = None, **options: Any) -> Any:
    async def ask() -> Any:
        async with AsyncRoverTwin(url, **settings or {}) as twin:
            answer = getattr(twin, word)(*args, **options)
            return [each async for each in answer] if isinstance(answer, AsyncIterator) else await answer

    return asyncio.run(ask())


@pytest.fixture(params=[ask_sync, ask_async], ids=["sync", "async"])
def ask(request: pytest.FixtureRequest) -> Ask:
    """Asks one question with a client of its own, synchronous or asynchronous."""
    return request.param


@pytest.fixture
def map_answer() -> dict[str, Any]:
    """A map of two torques and three slopes; on the weaker torque nothing is climbed."""
    torques = {"torque_min_nm": "0", "torque_max_nm": "40", "torque_steps": "2"}
    slopes = {"slope_min_deg": "10", "slope_max_deg": "30", "slope_steps": "3"}
    return mobility_document({"mass_kg": "430", **torques, **slopes})


@pytest.fixture
def suggestions_answer() -> dict[str, Any]:
    """Two suggested runs."""
    return suggested_runs_document("viper-lunar", 3, 2)
