"""Queries read into models: each field once, faults in the words of FastAPI's own reading."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar
from urllib.parse import parse_qsl

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ValidationError

from service.wire.faults import require_unique

Model = TypeVar("Model", bound=BaseModel)
_NONE: frozenset[str] = frozenset()


def read_query(
    request: Request, model: type[Model], allowed: Mapping[str, str], may_repeat: frozenset[str] = _NONE
) -> Model:
    """The query as a model; the fields of `may_repeat` are lists.

    Raises InvalidInputError, in the words of `allowed`, for a field that is there twice, and RequestValidationError.
    """
    pairs = parse_qsl(request.scope["query_string"].decode("latin-1"), keep_blank_values=True)
    values: dict[str, object] = dict(pairs)
    if len(values) < len(pairs):
        require_unique(pairs, allowed, may_repeat)
    for name in may_repeat & values.keys():
        values[name] = [value for each, value in pairs if each == name]
    return validated(model, values, "query")


def validated(model: type[Model], values: object, place: str) -> Model:
    """Values as a model. Raises RequestValidationError, whose faults are at that place of the request."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        faults = [{**each, "loc": (place, *each["loc"])} for each in error.errors(include_url=False)]
        raise RequestValidationError(faults) from None
