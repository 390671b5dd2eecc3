"""The floors over HTTP: what the same server costs when it computes nothing. `python -m tests.benchmarks.floors PORT`

Uvicorn with uvloop and httptools, one process, one thread, bare Starlette routes: `/tiny` answers a few bytes of JSON
(floor b), `/bytes/{name}` what was put there before, headers and all (floor a).
"""

from __future__ import annotations

import sys

import orjson
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from tests.benchmarks.client import Answer, Connection, Question

_KEPT: dict[str, tuple[bytes, dict[str, str]]] = {}
_HEADERS = "x-kept-headers"
_OWN = {"date", "server", "content-length", "transfer-encoding"}  # the server writes these itself


async def tiny(_request: Request) -> Response:
    return JSONResponse({"status": "ready"})


async def kept(request: Request) -> Response:
    await request.body()
    body, headers = _KEPT[request.path_params["name"]]
    return Response(body, headers=headers)


async def keep(request: Request) -> Response:
    headers = orjson.loads(request.headers[_HEADERS])
    _KEPT[request.path_params["name"]] = await request.body(), headers
    return JSONResponse({"kept": len(headers)})


def keep_answer(connection: Connection, name: str, answer: Answer) -> str:
    """Have the floor server answer what the service did; the path to ask for."""
    headers = {key.lower(): value for key, value in answer.headers.items() if key.lower() not in _OWN}
    path = f"/bytes/{name}"
    connection.ask(Question("PUT", path, {_HEADERS: orjson.dumps(headers).decode()}, answer.body))
    return path


def main() -> None:
    routes = [
        Route("/ready", tiny),
        Route("/tiny", tiny),
        Route("/bytes/{name}", kept, methods=["GET", "POST"]),
        Route("/bytes/{name}", keep, methods=["PUT"]),
    ]
    application = Starlette(routes=routes)
    uvicorn.run(
        application, port=int(sys.argv[1]), loop="uvloop", http="httptools", access_log=False, log_level="warning"
    )


if __name__ == "__main__":
    main()
