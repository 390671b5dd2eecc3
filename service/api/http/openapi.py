"""The OpenAPI document: FastAPI's, completed with the problems that each route can answer."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import BaseModel

from service.api.http.problems import PROBLEM_MEDIA_TYPE, PROBLEMS, Problem, ProblemKind, Slug

_COMPONENTS = "#/components/schemas/"
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


def operation_id(route: APIRoute) -> str:
    """The name of the method in a generated client: that of the endpoint, a verb and a noun, unique in the service."""
    return route.name


def openapi_of(app: FastAPI) -> dict[str, Any]:
    """The whole document; computed once per app."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title,
            version=app.version,
            summary=app.summary,
            description=app.description,
            routes=app.routes,
            tags=app.openapi_tags,
        )
        _without_defaults(document)
        _json_first(document)
        problem = Problem.model_json_schema(ref_template=_COMPONENTS + "{model}")
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        for name, schema in {**problem.pop("$defs", {}), "Problem": problem}.items():
            schemas.setdefault(name, schema)
        app.openapi_schema = document
    return app.openapi_schema


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


def inlined_schema(model: type[BaseModel]) -> dict[str, Any]:
    """A JSON schema without references, for bodies that FastAPI does not read."""
    schema = model.model_json_schema()
    definitions = schema.pop("$defs", {})

    def resolved(node: object) -> object:
        if isinstance(node, list):
            return [resolved(each) for each in node]
        if not isinstance(node, dict):
            return node
        if "$ref" in node:
            return resolved(definitions[node["$ref"].rpartition("/")[2]])
        return {name: resolved(each) for name, each in node.items()}

    return {name: resolved(each) for name, each in schema.items()}
