"""Routes that are put together once, and when they are needed."""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection
from functools import cached_property
from typing import Any

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette._utils import get_route_path
from starlette.routing import BaseRoute, Match, compile_path
from starlette.types import Receive, Scope, Send

from service.api.http.lanes import LaneRoute
from service.api.http.openapi import operation_id


class LateRoute(BaseRoute):
    """Stands for a route of FastAPI, which is made when the first request for its address comes.

    To make one takes some milliseconds: all signatures are read, all fields prepared.
    """

    def __init__(self, path: str, methods: Collection[str], make: Callable[[], APIRoute]) -> None:
        self.path, self.methods = path, frozenset(methods)
        self._pattern = compile_path(path)[0]
        self._make = make

    @cached_property
    def made(self) -> APIRoute:
        """The route itself. Raises what FastAPI raises for one that is declared wrongly."""
        return self._make()

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """As of the route itself."""
        if scope["type"] != "http" or not self._pattern.match(get_route_path(scope)):
            return Match.NONE, {}
        return self.made.matches(scope)

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """As the route itself."""
        await self.made.handle(scope, receive, send)


class Router(APIRouter):
    """FastAPI's router, whose routes an app takes as they are, prefix and all; `include_router` would make them anew.

    Lanes, which are asked by the thousand, are made at once, all others are late.
    """

    def __init__(self, **given: Any) -> None:  # noqa: ANN401 - as FastAPI's
        super().__init__(**given, generate_unique_id_function=operation_id)

    def add_api_route(
        self,
        path: str,
        endpoint: Callable[..., Any],
        *,
        methods: Collection[str] | None = None,
        route_class_override: type[APIRoute] | None = None,
        **given: Any,  # noqa: ANN401 - as FastAPI's
    ) -> None:
        """Like FastAPI's, but what is wrong with a declaration is raised when the route is made."""
        known = sorted(methods or ("GET",))

        def make() -> APIRoute:
            apart = copy.copy(self)
            apart.routes = []
            APIRouter.add_api_route(
                apart, path, endpoint, methods=known, route_class_override=route_class_override, **given
            )
            [route] = apart.routes
            assert isinstance(route, APIRoute)
            return route

        lane = issubclass(route_class_override or self.route_class, LaneRoute)
        self.routes.append(make() if lane else LateRoute(self.prefix + path, known, make))
