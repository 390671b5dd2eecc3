"""A short way for the requests that come by the thousand.

FastAPI works out the dependencies of a route anew for each request and compares it with one address after the other:
that takes longer than the arithmetic. A `LaneRoute` stands in the OpenAPI document like any other and can be reached
like any other; `Lanes`, the innermost middleware, only finds it first.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, TypeVar

from fastapi import APIRouter, Request, Response
from starlette.routing import compile_path
from starlette.types import ASGIApp, Receive, Scope, Send

from service.api.http.errors import ErrorAnswers, own_path
from service.api.http.reading import Answer, Route

AtOnce = Callable[[Request], Response | None]
"""Answers a request without waiting, or says None: then nothing has happened."""
_AT_ONCE = "at_once"
Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])


def answered_at_once(function: Callable[..., Response | None]) -> Callable[[Endpoint], Endpoint]:
    """A decorator of the endpoint of a lane without a body: `function`, of the same arguments, answers without waiting.

    It returns None where it cannot, before anything has happened: then the endpoint is asked.
    """

    def marked(endpoint: Endpoint) -> Endpoint:
        setattr(endpoint, _AT_ONCE, function)
        return endpoint

    return marked


@dataclass(frozen=True, slots=True)
class Lane:
    """One method of one address and what answers it; `path` is a template, as a route's.

    `at_once` may answer without waiting.
    """

    method: str
    path: str
    answer: Answer
    at_once: AtOnce | None = None


class LaneRoute(Route):
    """A route whose endpoint takes, by name: query and body, parts of the address as text, `request` and `services`."""

    async def answer(self, request: Request) -> Response:
        """The endpoint's answer. Errors are raised: whoever calls makes problems of them."""
        self.admit(request)
        arguments = {**request.path_params, **await self.read(request)}
        response: Response = await self.endpoint(
            **arguments, request=request, services=request.scope["state"]["services"]
        )
        return response

    def at_once(self, request: Request) -> Response | None:
        """What the function says by which the endpoint is `answered_at_once`."""
        self.admit(request)
        function = getattr(self.endpoint, _AT_ONCE)
        arguments = self.read_query(request)
        response: Response | None = function(**arguments, request=request, services=request.scope["state"]["services"])
        return response

    def get_route_handler(self) -> Answer:
        """What FastAPI calls when a request took the long way."""
        self.declare()
        return self.answer


def lanes_of(router: APIRouter) -> list[Lane]:
    """The lanes to the lane routes of a router."""
    routes = [each for each in router.routes if isinstance(each, LaneRoute)]
    return [
        Lane(method, route.path, route.answer, route.at_once if hasattr(route.endpoint, _AT_ONCE) else None)
        for route in routes
        for method in sorted(route.methods or ())
    ]


class Lanes:
    """ASGI middleware, to be the innermost one: answers requests for the addresses of `lanes`, hands on the rest."""

    def __init__(self, app: ASGIApp, lanes: Iterable[Lane], answer_to: ErrorAnswers) -> None:
        self.app = app
        self.answer_to = answer_to
        self._plain: dict[tuple[str, str], Lane] = {}
        self._patterns: list[tuple[re.Pattern[str], Lane]] = []
        for lane in lanes:
            pattern, _, parameters = compile_path(lane.path)
            if parameters:
                self._patterns.append((pattern, lane))
            else:
                self._plain[lane.method, lane.path] = lane

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        # behind a proxy that strips a prefix the router knows better which address is meant
        if scope["type"] != "http" or scope.get("root_path") or (lane := self._find(scope)) is None:
            await self.app(scope, receive, send)
            return
        scope["route"] = lane
        try:
            response = await lane.answer(Request(scope, receive, send))
        except Exception as error:
            response = self.answer_to(error, own_path(scope))
        await response(scope, receive, send)

    def _find(self, scope: Scope) -> Lane | None:
        method, path = scope["method"], scope["path"]
        lane = self._plain.get((method, path))
        if lane is None:
            for pattern, each in self._patterns:
                if each.method == method and (found := pattern.match(path)):
                    scope["path_params"] = found.groupdict()
                    return each
        return lane
