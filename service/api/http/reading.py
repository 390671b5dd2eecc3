"""The one way to read a request: query and body as models, each field known and sent once, faults in the model's words.

A route declares what it reads as FastAPI's routes do, with `Annotated[Model, Query()]` and `Annotated[Model, Body()]`,
and stands in the OpenAPI document so. `Route` reads both itself: FastAPI takes unknown fields of a query for none and
the last of two values for the value.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass, replace
from email.message import Message
from functools import lru_cache
from typing import Annotated, Any, TypeVar, get_args, get_origin
from urllib.parse import parse_qsl

import orjson
from fastapi import Request, Response
from fastapi._compat import ModelField
from fastapi.dependencies.models import Dependant
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from starlette.requests import ClientDisconnect

from service.allowed import Words, allowed_fields, allowed_values
from service.api.http.exceptions import UnsupportedMediaTypeError
from service.api.http.sent_headers import first_sent
from service.wire.faults import InvalidInputError, MalformedBodyError, fault, faults_of, require_unique

Model = TypeVar("Model", bound=BaseModel)
Answer = Callable[[Request], Coroutine[Any, Any, Response]]

_MOST_MEMBERS = 1000  # no object here has nearly as many; to find a fault in each of them would take seconds
_NESTED = (dict, list)
_READ, _READ_QUERY = "service.read", "service.read_query"
_REQUEST = "__request"


class NoQuery(BaseModel):
    """The query of an address that takes none."""

    model_config = ConfigDict(extra="forbid")


@lru_cache(maxsize=64)
def words_of(model: type[BaseModel]) -> Mapping[str, str]:
    """What each field of a model allows, in words; `x-allowed` of a field's schema wins over what its type says."""
    return allowed_fields(model.model_json_schema())


@lru_cache(maxsize=64)
def _lists_of(model: type[BaseModel]) -> frozenset[str]:
    return frozenset(name for name, field in model.model_fields.items() if _is_list(field.annotation))


def _is_list(annotation: object) -> bool:
    """Whether values of this kind are lists, or may be."""
    parts = get_args(annotation)
    return get_origin(annotation) is list or any(_is_list(each) for each in parts if get_args(each))


def query_pairs(request: Request) -> list[tuple[str, str]]:
    """Every name of the query with its value, in order."""
    query = request.scope["query_string"].decode("latin-1")
    if "%" in query or "+" in query or not query.isascii():
        return parse_qsl(query, keep_blank_values=True)
    # nothing is escaped: to look for that in each part takes ten times as long
    return [(part[0], part[2]) for part in [each.partition("=") for each in query.split("&")] if part[1] or part[0]]


def read_query(request: Request, model: type[Model]) -> Model:
    """The query as a model. Raises InvalidInputError; only fields that are lists may come more than once."""
    pairs = query_pairs(request)
    values: dict[str, object] = dict(pairs)
    lists = _lists_of(model)
    if len(values) < len(pairs):
        require_unique(pairs, words_of(model), lists)
    if not lists.isdisjoint(values):
        for name in lists & values.keys():
            values[name] = [value for each, value in pairs if each == name]
    return validated(model, values, "query")


async def whole_body(request: Request) -> bytes:
    """What `Request.body` returns, for who reads it once: most bodies come in one piece. Raises ClientDisconnect."""
    pieces, more = [], True
    while more:
        message = await request.receive()
        if message["type"] == "http.disconnect":
            raise ClientDisconnect
        pieces.append(message.get("body", b""))
        more = message.get("more_body", False)
    request._body = content = pieces[0] if len(pieces) == 1 else b"".join(pieces)
    return content


async def read_body(request: Request, model: type[Model]) -> Model:
    """The body as a model. Raises InvalidInputError, MalformedBodyError and UnsupportedMediaTypeError."""
    require_json(request)
    content = await request.body()
    parsed(content, words_of(model))
    try:
        return model.model_validate_json(content, strict=True)  # numbers must be numbers
    except ValidationError as error:
        raise _refused(error, model, "body") from error


def validated(model: type[Model], values: object, place: str) -> Model:
    """Values as a model. Raises InvalidInputError; `place` is where in the request they were."""
    try:
        found: Model = model.__pydantic_validator__.validate_python(values)  # `model_validate` only asks for it
    except ValidationError as error:
        raise _refused(error, model, place) from error
    return found


def _refused(error: ValidationError, model: type[BaseModel], place: str) -> InvalidInputError | MalformedBodyError:
    errors: list[dict[str, Any]] = [{**each, "loc": (place, *each["loc"])} for each in error.errors(include_url=False)]
    if errors[0]["type"] == "json_invalid":  # what Python's parser takes and pydantic's does not
        return MalformedBodyError(f"the body cannot be read as JSON: {errors[0]['ctx']['error']}")
    return InvalidInputError(*faults_of(errors, words_of(model)))


def require_json(request: Request) -> None:
    """Refuse a body that does not say it is JSON. Raises UnsupportedMediaTypeError."""
    coding = first_sent(request.scope, b"content-encoding")
    if coding is not None and coding.lower() != "identity":
        raise UnsupportedMediaTypeError(f"Content-Encoding is {coding[:100]!r}, allowed is identity")
    sent = first_sent(request.scope, b"content-type") or ""
    if sent == "application/json":
        return
    message = Message()
    message["content-type"] = sent
    kind = message.get_content_subtype()
    if not sent or message.get_content_maintype() != "application" or not (kind == "json" or kind.endswith("+json")):
        said = repr(sent[:100]) if sent else "missing"
        raise UnsupportedMediaTypeError(f"Content-Type is {said}, allowed is application/json")


def parsed(content: bytes, words: Mapping[str, str]) -> Any:  # noqa: ANN401 - JSON
    """What JSON says; NaN and infinity pass, so that they can be refused by the name of their field.

    Raises MalformedBodyError, and InvalidInputError, in `words`, for a field that is there twice at any depth.
    """
    if not content:
        raise MalformedBodyError("the body is empty; send a JSON object")
    try:
        found = orjson.loads(content)
        # Each name has a colon after it. Where there are more colons than names, texts have some, or names repeat.
        if content.count(b":") == _names_in(found):
            return found
    except (orjson.JSONDecodeError, RecursionError):
        pass  # the careful way, below, has better words

    def without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        _require_few_members(len(pairs))
        members = dict(pairs)
        if len(members) < len(pairs):
            require_unique(pairs, words)
        return members

    try:
        return json.loads(content, object_pairs_hook=without_repeats)
    except json.JSONDecodeError as error:
        raise MalformedBodyError(f"the body cannot be read as JSON: {error}") from error
    except (RecursionError, ValueError) as error:
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)[:200]
        raise MalformedBodyError(f"the body cannot be read: {reason}") from error


def _require_few_members(count: int) -> None:
    if count > _MOST_MEMBERS:
        raise InvalidInputError(fault("body", f"{count} members", f"an object with at most {_MOST_MEMBERS} members"))


def _names_in(node: object) -> int:
    """How many names the objects have. A list that begins with a plain value counts as none."""
    if isinstance(node, dict):
        _require_few_members(len(node))
        found = len(node)
        for each in node.values():
            if each and isinstance(each, _NESTED) and (isinstance(each, dict) or isinstance(each[0], _NESTED)):
                found += _names_in(each)
        return found
    if isinstance(node, list) and node and isinstance(node[0], _NESTED):
        return sum(map(_names_in, node))
    return 0


@dataclass(frozen=True, slots=True)
class _Declared:
    """The argument of an endpoint that is read from query or body, and its model."""

    name: str
    model: type[BaseModel]
    default: object = ...

    @classmethod
    def of(cls, fields: list[ModelField]) -> _Declared | None:
        """Raises TypeError for what this module does not read: fields beside a model, or several models."""
        if not fields:
            return None
        annotation = fields[0].field_info.annotation
        models = [each for each in (annotation, *get_args(annotation)) if isinstance(each, type)]
        models = [each for each in models if issubclass(each, BaseModel)]
        if len(fields) > 1 or not models:
            raise TypeError(f"{[field.name for field in fields]}: declare one model for the query and one for the body")
        default = ... if fields[0].field_info.is_required() else fields[0].field_info.default
        return cls(fields[0].name, models[0], default)


class Route(APIRoute):
    """A route whose query and body are read as this module does.

    One that declares no query takes none, unless it documents parameters of its own: then its endpoint reads them.
    """

    def admit(self, request: Request) -> None:
        """Called before anything is read; raises for a request that is not to be read at all."""

    async def read(self, request: Request) -> dict[str, Any]:
        """The arguments that come from query and body, by name."""
        query, body = self.read_query(request), self._body
        if body is None:
            return query
        sent = body.default is ... or await request.body()
        return {**query, body.name: await read_body(request, body.model) if sent else body.default}

    def read_query(self, request: Request) -> dict[str, Any]:
        """Those that come from the query. Who asks again gets the same ones."""
        known: dict[str, Any] | None = request.scope.get(_READ_QUERY)
        if known is not None:
            return known
        query, found = self._query, dict[str, Any]()
        if query is not None:
            found[query.name] = read_query(request, query.model)
        elif request.scope["query_string"] and not self._takes_any_query:
            read_query(request, NoQuery)
        request.scope[_READ_QUERY] = found
        return found

    def declare(self) -> None:
        """Find out what the endpoint declares. Raises TypeError for what this module does not read."""
        self._query, self._body = _Declared.of(self.dependant.query_params), _Declared.of(self.dependant.body_params)
        self._takes_any_query = "parameters" in (self.openapi_extra or {})

    def get_route_handler(self) -> Answer:
        """FastAPI's, which reads the rest: address, headers, dependencies."""
        self.declare()
        bare = copy.copy(self)
        bare.dependant, bare.body_field = _bare(self.dependant), None
        words = Words(lambda: {each.name: _words_of(each) for each in self.dependant.path_params})
        handle = APIRoute.get_route_handler(bare)

        async def handle_read(request: Request) -> Response:
            self.admit(request)
            request.scope[_READ] = await self.read(request)
            try:
                return await handle(request)
            except RequestValidationError as error:
                raise InvalidInputError(*faults_of(error.errors(), words)) from error

        return handle_read


def _words_of(field: ModelField) -> str:
    """What a part of the address allows."""
    kind: Any = Annotated[field.field_info.annotation, field.field_info]
    return allowed_values(TypeAdapter(kind).json_schema())


def _bare(dependant: Dependant) -> Dependant:
    """The same endpoint for FastAPI, without query and body: those are put beside its arguments when it is called."""
    endpoint = dependant.call
    assert endpoint is not None
    name = dependant.request_param_name

    async def call(**arguments: Any) -> Any:  # noqa: ANN401 - the endpoint's own
        request: Request = arguments[name] if name else arguments.pop(_REQUEST)
        return await endpoint(**arguments, **request.scope[_READ])

    return replace(dependant, query_params=[], body_params=[], call=call, request_param_name=name or _REQUEST)
