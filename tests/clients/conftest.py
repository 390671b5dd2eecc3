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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route

NEAREST_RUN = {
    "run": "s28_m430_t60",
    "slope_deg": 28,
    "mass_kg": 430,
    "torque_nm": 60,
    "held_out_final_error_m": 0.0074,
    "distance": 0.41,
}


def prediction_document(query: dict[str, str]) -> dict[str, Any]:
    """What the service answers (contract of /v1/predictions), for a rover that moves 0.1 m/s uphill."""
    across = "z_m" if query.get("frame") == "world" else "y_m"
    time_s = [0.0, 5.0, float(query["horizon_s"])]
    trajectory = {"time_s": time_s, "x_m": [0.1 * t for t in time_s], across: [0.0, 0.01, 0.02]}
    answer = {
        "model": {"name": "viper-lunar", "version": 3, "alias": "champion"},
        "scenario": {k: float(query[k]) for k in ("slope_deg", "mass_kg", "torque_nm", "horizon_s")},
        "frame": query.get("frame", "slope"),
        "trajectory": trajectory,
        "domain": {"inside": True, "reasons": [], "distance": 0.41, "nearest_runs": [dict(NEAREST_RUN)]},
        "summary": {
            "outcome": "climbs",
            "final_x_m": 0.1 * time_s[-1],
            "final_y_m": 0.02,
            "distance_m": 1.0,
            "mean_speed_m_s": 0.1,
            "slip_ratio": 0.55,
        },
    }
    if "prior" in query.get("include", ""):
        answer["prior"] = {"name": "motor_slope", "x_m": [0.0, 0.4, 0.9], across: [0.0, 0.0, 0.0]}
    if "band" in query.get("include", ""):
        bounds = ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")
        level = float(query.get("band_level", "0.9"))
        answer["band"] = {"level": level} | {name: [0.0, 0.5, 1.0 + at] for at, name in enumerate(bounds)}
    return answer


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
    """Counts the questions of each behaviour; `busy-once` recovers at the second, `slow` takes a second."""

    def __init__(self, hits: Counter[str]) -> None:
        self.hits = hits

    async def answer(self, request: Request) -> Response:
        kind = request.path_params["kind"]
        self.hits[kind] += 1
        if kind == "busy-once":
            return busy(0) if self.hits[kind] == 1 else predictions(request)
        if kind == "slow":
            await asyncio.sleep(1.0)
            return predictions(request)
        return MISBEHAVIOURS[kind]()


@dataclass
class ContractService:
    url: str
    hits: Counter[str] = field(default_factory=Counter)


@pytest.fixture(scope="session")
def contract_service() -> Iterator[ContractService]:
    """The server, on a free port of the loopback interface, for the whole session."""
    hits: Counter[str] = Counter()
    misbehaviour = Misbehaviour(hits).answer
    app = Starlette(
        routes=[
            Route("/v1/predictions", predictions),
            Route("/v1/models", models),
            Route("/v1/models/{name}", model),
            Route("/v1/models/{name}/versions/{version:int}", manifest),
            Route("/health/ready", ready),
            Route("/{kind}/v1/predictions", misbehaviour),
            Route("/{kind}/health/ready", misbehaviour),
        ]
    )
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
