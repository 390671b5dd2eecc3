"""Errors under `/v2` have the protocol's form, `{"error": text}`, and Triton's statuses.

Internal 500, not found 404, unavailable 503, unsupported 501, everything else 400. What HTTP itself says about a
request (405, 413, 415) keeps its status.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import orjson
from fastapi import Response
from pydantic import BaseModel, Field

from service.api.http.errors import Told
from service.api.http.openapi import schema_of
from service.api.http.problems import PROBLEMS, Slug
from service.errors import RoverTwinError

PREFIX = "/v2"
_NOT_THERE = frozenset({Slug.VERSION_ARCHIVED, Slug.VERSION_DELETED})  # the protocol knows no 409 and no 410
_UNPROCESSABLE = 422  # of our own routes; the protocol knows 400 only
_MEANINGS = {
    400: "The request is malformed, or a tensor or parameter is not allowed; `error` names it, its value and range.",
    401: "The address needs a token of the operator.",
    403: "The token may only read, or this service has none and no such address is on.",
    404: "There is no such model or version.",
    413: "The body is over the limit, as sent or unpacked.",
    415: "The body has a `Content-Encoding` other than gzip or deflate.",
    429: "Wrong tokens keep coming from this address; the right one is let in at once.",
    500: "A fault of the service.",
    501: "A part of the protocol, or a library for the model, that this service does not have.",
    503: "It cannot be answered now: not ready, overloaded, or what is stored cannot be used.",
}


class UnsupportedError(RoverTwinError):
    """A part of the protocol that this service does not have."""


class InferenceFailure(BaseModel):
    """The error form of the protocol."""

    error: str = Field(description="What is wrong, in one line.")


def failure(error: Exception, tell: Callable[[Exception], Told]) -> Response:
    """The answer to an error in the protocol's form; `tell` says what there is to tell of it."""
    if isinstance(error, UnsupportedError):
        return _response(501, str(error), {})
    told = tell(error)
    status = 404 if told.slug in _NOT_THERE else PROBLEMS[told.slug].status
    return _response(400 if status == _UNPROCESSABLE else status, told.detail, told.headers)


def failure_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The `responses` of a route that can fail in these ways, or by a fault of the service."""
    content = {"application/json": {"schema": schema_of(InferenceFailure)}}
    return {status: {"description": _MEANINGS[status], "content": content} for status in sorted({*statuses, 500})}


def _response(status: int, detail: str, headers: Mapping[str, str]) -> Response:
    return Response(orjson.dumps({"error": detail}), status, dict(headers), "application/json")
