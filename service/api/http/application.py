"""FastAPI with our middlewares outermost."""

from __future__ import annotations

from typing import Any

from fastapi import FastAPI
from starlette.types import ASGIApp

from service.api.http.at_once import AnswersAtOnce


class Application(FastAPI):
    """FastAPI puts an answer to errors, telemetry and a limit for bodies around the middlewares that it is given.

    `RequestLog` answers all errors, telemetry is off and `BodyLimit` is ours: each request would only go through them.

    A server may ask `at_once` first, where there is one.
    """

    at_once: AnswersAtOnce | None = None

    def build_middleware_stack(self) -> ASGIApp:
        """From our outermost middleware on."""
        stack: Any = super().build_middleware_stack()
        outermost: Any = self.user_middleware[0].cls
        while type(stack) is not outermost:
            stack = stack.app
        ours: ASGIApp = stack
        return ours
