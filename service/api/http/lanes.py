"""A short way for the requests that come by the thousand.

FastAPI works out the dependencies of a route anew for each request and passes it through its layers and one address
after the other: that takes longer than the arithmetic. An *express* route reads its input itself. It stands in the
OpenAPI document like any other and can be reached like any other; `Application` only finds it first.
"""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Coroutine, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, FastAPI, Request, Response
from fastapi.routing import APIRoute
from starlette.routing import compile_path
from starlette.types import ASGIApp, Receive, Scope, Send

Answer = Callable[[Request], Coroutine[Any, Any, Response]]
Read = Callable[[Request], Awaitable[dict[str, Any]]]
Wrap = Callable[[ASGIApp], ASGIApp]


@dataclass(frozen=True, slots=True)
class Lane:
    """One method of one address and what answers it; `path` is a template, as a route's."""

    method: str
    path: str
    answer: Answer


class ExpressRoute(APIRoute):
    """A route whose endpoint takes what `read` makes of the request, and `request` and `parts`.

    `read` is a member of the subclasses that `express_route` makes.
    """

    read: Read

    async def answer(self, request: Request) -> Response:
        """The endpoint's answer. Errors are raised: whoever calls makes problems of them."""
        arguments = await type(self).read(request)
        response: Response = await self.endpoint(**arguments, request=request, parts=request.scope["state"]["services"])
        return response

    def get_route_handler(self) -> Answer:
        """What FastAPI calls when a request took the long way."""
        return self.answer


def lanes_of(router: APIRouter) -> list[Lane]:
    """The short ways to the express routes of a router."""
    routes = [each for each in router.routes if isinstance(each, ExpressRoute)]
    return [Lane(method, route.path, route.answer) for route in routes for method in sorted(route.methods or ())]


def express_route(read: Read) -> type[APIRoute]:
    """The class of routes whose input `read` reads; what it raises is answered as any error of a route is."""
    return type("ExpressRoute", (ExpressRoute,), {"read": staticmethod(read)})


class Application(FastAPI):
    """FastAPI, with lanes that are looked up before its own routes."""

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - FastAPI's own
        super().__init__(**settings)
        self._plain: dict[tuple[str, str], Lane] = {}
        self._patterns: list[tuple[re.Pattern[str], Lane]] = []
        self._express: ASGIApp = self._answer

    def open_lanes(self, lanes: Iterable[Lane], layers: Sequence[Wrap]) -> None:
        """Let requests for these addresses through `layers` only, the first one outermost; they must answer errors."""
        for lane in lanes:
            pattern, _, parameters = compile_path(lane.path)
            if parameters:
                self._patterns.append((pattern, lane))
            else:
                self._plain[lane.method, lane.path] = lane
        self._express = self._answer
        for wrap in reversed(layers):
            self._express = wrap(self._express)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        # behind a proxy that strips a prefix the router knows better which address is meant
        if scope["type"] == "http" and not scope.get("root_path") and self._find(scope):
            await self._express(scope, receive, send)
        else:
            await super().__call__(scope, receive, send)

    def _find(self, scope: Scope) -> bool:
        method, path = scope["method"], scope["path"]
        lane = self._plain.get((method, path))
        if lane is None:
            for pattern, each in self._patterns:
                if each.method == method and (found := pattern.match(path)):
                    scope["path_params"] = found.groupdict()
                    lane = each
                    break
        if lane is None:
            return False
        scope["app"], scope["route"] = self, lane
        return True

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        response = await scope["route"].answer(Request(scope, receive, send))
        await response(scope, receive, send)
