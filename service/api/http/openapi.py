"""The OpenAPI document: FastAPI's, completed with the problems that each route can answer."""

from __future__ import annotations

import warnings
from collections import defaultdict
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode, models_json_schema
from pydantic.warnings import UnsupportedFieldAttributeWarning

from service.api.http.problems import PROBLEM_MEDIA_TYPE, PROBLEMS, Problem, ProblemKind, Slug

_COMPONENTS = "#/components/schemas/"
_declared: dict[str, type[BaseModel]] = {}
_EVERYWHERE = (Slug.HEAD_TOO_LARGE, Slug.INTERNAL)


def problem_responses(*slugs: Slug) -> dict[int | str, dict[str, Any]]:
    """The `responses` of a route that can end in these problems, in too large a head, or in an internal error."""
    by_status: dict[int, list[ProblemKind]] = defaultdict(list)
    for slug in (*slugs, *_EVERYWHERE):
        by_status[PROBLEMS[slug].status].append(PROBLEMS[slug])
    return {status: _response(kinds) for status, kinds in sorted(by_status.items())}


def _response(kinds: list[ProblemKind]) -> dict[str, Any]:
    return {
        "description": " ".join(f"**{kind.slug}**: {kind.meaning}" for kind in kinds),
        "content": {
            PROBLEM_MEDIA_TYPE: {
                "schema": {"$ref": _COMPONENTS + "Problem"},
                "examples": {kind.slug.value: {"value": _example(kind)} for kind in kinds},
            }
        },
    }


def _example(kind: ProblemKind) -> dict[str, Any]:
    detail = f"{kind.title}: what exactly, in one line"
    document: dict[str, Any] = {
        "type": kind.type,
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        "instance": "/v1/predictions",
        "error": detail,
    }
    if kind.slug is Slug.INVALID_INPUT:
        said = "slope_deg is '90', allowed is -45 to 45"
        document["errors"] = [{"field": "slope_deg", "value": "90", "allowed": "-45 to 45", "message": said}]
        document["detail"] = document["error"] = said
    return document


def form_of(text: bool, meaning: str) -> dict[str, Any]:
    """The content of one form of an answer: text, or bytes, which generated clients hand over as such."""
    return {"schema": {"type": "string", **({} if text else {"format": "binary"}), "description": meaning}}


def schema_of(model: type[BaseModel]) -> dict[str, Any]:
    """A reference to the schema of a body that FastAPI does not read: so that generated clients have it once, by name.

    Raises ValueError for another model of the same name.
    """
    if _declared.setdefault(model.__name__, model) is not model:
        raise ValueError(f"two bodies are called {model.__name__}")
    return {"$ref": _COMPONENTS + model.__name__}


def operation_id(route: APIRoute) -> str:
    """The name of the method in a generated client: that of the endpoint, a verb and a noun, unique in the service."""
    return route.name


def openapi_of(app: FastAPI) -> dict[str, Any]:
    """The whole document; computed once per app."""
    if app.openapi_schema is None:
        with warnings.catch_warnings():
            # FastAPI does so where it makes its fields; what is deferred (service/__init__.py) is made here
            warnings.simplefilter("ignore", UnsupportedFieldAttributeWarning)
            document = get_openapi(
                title=app.title,
                version=app.version,
                summary=app.summary,
                description=app.description,
                routes=[getattr(each, "made", each) for each in app.routes],  # those that are late are made now
                tags=app.openapi_tags,
            )
        _without_defaults(document)
        _json_first(document)
        problem = Problem.model_json_schema(ref_template=_COMPONENTS + "{model}")
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        for name, schema in {**_bodies(), **problem.pop("$defs", {}), "Problem": problem}.items():
            schemas.setdefault(name, schema)
        app.openapi_schema = document
    return app.openapi_schema


def _bodies() -> dict[str, Any]:
    """The schemas that `schema_of` referred to, with those that they refer to."""
    models: list[tuple[type[BaseModel], JsonSchemaMode]] = [(each, "validation") for each in _declared.values()]
    found: dict[str, Any] = models_json_schema(models, ref_template=_COMPONENTS + "{model}")[1]
    return dict(found.get("$defs", {}))


def _json_first(document: dict[str, Any]) -> None:
    """Swagger asks for the first form of an answer that a document lists."""
    for operations in document["paths"].values():
        for operation in operations.values():
            for response in operation["responses"].values():
                content = response.get("content", {})
                if "application/json" in content:
                    response["content"] = {"application/json": content["application/json"], **content}


def _without_defaults(document: dict[str, Any]) -> None:
    """Remove FastAPI's own form of validation errors: here they are problems, or cannot happen."""
    for operations in document["paths"].values():
        for operation in operations.values():
            if PROBLEM_MEDIA_TYPE not in operation["responses"].get("422", {}).get("content", {}):
                operation["responses"].pop("422", None)
    for name in ("HTTPValidationError", "ValidationError"):
        document["components"]["schemas"].pop(name, None)
