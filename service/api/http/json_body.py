"""JSON bodies that can be read in one way only: they say that they are JSON, and name no field twice."""

from __future__ import annotations

import json
from collections.abc import Mapping
from email.message import Message
from typing import Any, TypeVar

from fastapi import HTTPException, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ValidationError

from service.api.http.exceptions import UnsupportedMediaTypeError
from service.wire.faults import InvalidInputError, fault, faults_of, require_unique

Model = TypeVar("Model", bound=BaseModel)

_EMPTY = {"type": "missing", "loc": ("body",), "msg": "the body is empty", "input": None}
_MOST_MEMBERS = 1000  # no object here has nearly as many; to find a fault in each of them would take seconds


def require_json_type(request: Request) -> None:
    """Refuse a body that does not say it is JSON. Raises UnsupportedMediaTypeError."""
    sent = request.headers.get("content-type", "")
    message = Message()
    message["content-type"] = sent
    kind = message.get_content_subtype()
    if not sent or message.get_content_maintype() != "application" or not (kind == "json" or kind.endswith("+json")):
        said = repr(sent[:100]) if sent else "missing"
        raise UnsupportedMediaTypeError(f"Content-Type is {said}, allowed is application/json")


async def require_json_object(request: Request, allowed: Mapping[str, str]) -> None:
    """Refuse a body that does not say it is JSON or that names a field twice; `allowed` is what each field accepts.

    Raises UnsupportedMediaTypeError and InvalidInputError, and HTTPException (400) for what is no JSON.
    """
    require_json_type(request)
    body = await request.body()
    if body:
        try:
            _parsed(body, allowed)
        except json.JSONDecodeError as error:
            raise HTTPException(400) from error


async def read_object(request: Request, allowed: Mapping[str, str]) -> object:
    """What a JSON body says; an object unless the client errs.

    Raises what `require_json_object` raises, but RequestValidationError, as FastAPI's own reading does, for an empty
    body and for what is no JSON.
    """
    require_json_type(request)
    body = await request.body()
    if not body:
        raise RequestValidationError([_EMPTY])
    try:
        return _parsed(body, allowed)
    except json.JSONDecodeError as error:
        place, reason = ("body", error.pos), {"error": error.msg}
        found = {"type": "json_invalid", "loc": place, "msg": "JSON decode error", "input": {}, "ctx": reason}
        raise RequestValidationError([found]) from error


def _parsed(body: bytes, allowed: Mapping[str, str]) -> object:
    """JSON without a field that comes twice. It is small: the body limit sees to that.

    Raises JSONDecodeError, InvalidInputError, and HTTPException for what is not even text, or nested too deeply.
    """

    def without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(pairs) > _MOST_MEMBERS:
            allowed_members = f"an object with at most {_MOST_MEMBERS} members"
            raise InvalidInputError(fault("body", f"{len(pairs)} members", allowed_members))
        found = dict(pairs)
        if len(found) < len(pairs):
            require_unique(pairs, allowed)
        return found

    try:
        return json.loads(body, object_pairs_hook=without_repeats)
    except json.JSONDecodeError:
        raise
    except (RecursionError, ValueError) as error:
        raise HTTPException(400) from error


async def read_json(request: Request, model: type[Model], allowed: Mapping[str, str]) -> Model:
    """The body as a model. Strictly: numbers must be numbers, and at every depth no field may come twice.

    Raises InvalidInputError in the words of `allowed`, RequestValidationError (as FastAPI's own reading does) for what
    cannot be read, and what `require_json_object` raises.
    """
    body = await request.body()
    if not body:
        raise RequestValidationError([_EMPTY])
    await require_json_object(request, allowed)
    try:
        return model.model_validate_json(body, strict=True)
    except ValidationError as error:
        errors = [{**each, "loc": ("body", *each["loc"])} for each in error.errors(include_url=False)]
        if errors[0]["type"] == "json_invalid":
            raise RequestValidationError(errors) from error
        raise InvalidInputError(*faults_of(errors, allowed)) from error
