"""Routes are put together once, by the module that declares them."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from service.api.http.openapi import operation_id


class Router(APIRouter):
    """FastAPI's router, whose routes an app takes as they are, prefix and all.

    `include_router` would make each of them a second time: a tenth of a start.
    """

    def __init__(self, **given: Any) -> None:  # noqa: ANN401 - as FastAPI's
        super().__init__(**given, generate_unique_id_function=operation_id)
