"""The fields beside an upload's bytes: in the query of a raw body, in the parts of a form, or some here, some there."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import Field, StringConstraints

from service.api.http.reading import validated, words_of
from service.api.http.upload_body import FILE_PART, MAX_NAME_CHARACTERS
from service.datasets.uploads.upload_form import UploadForm
from service.wire.faults import InvalidInputError, fault, require_unique

_AS_JSON = ("passport", "column_map")


class UploadFields(UploadForm):
    """Everything that may come with an upload."""

    filename: Annotated[str, StringConstraints(min_length=1, max_length=MAX_NAME_CHARACTERS)] | None = Field(
        default=None, description="File name of a raw body. In a form, the part has its own."
    )
    dry_run: bool = Field(default=False, description="Validate and report only; nothing is stored.")

    def form(self) -> UploadForm:
        """Without what only the transport needs."""
        return UploadForm.model_validate(self.model_dump(include=set(UploadForm.model_fields), exclude_unset=True))


_PROPERTIES: dict[str, dict[str, Any]] = UploadFields.model_json_schema()["properties"]


def asked_for(pairs: Sequence[tuple[str, str]]) -> UploadFields:
    """The fields as one model. Raises InvalidInputError with every fault."""
    require_unique(pairs, words_of(UploadFields))
    given: dict[str, object] = dict(pairs)
    for name in _AS_JSON:
        if isinstance(text := given.get(name), str) and (name == "passport" or text.lstrip().startswith("{")):
            given[name] = _object(name, text)
    return validated(UploadFields, given, "form")


def _object(name: str, text: str) -> dict[str, Any]:
    try:
        found = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise InvalidInputError(fault(name, text, words_of(UploadFields)[name]))
    return found


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _plain(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    """What a form or a query can carry: JSON comes as text there, and null does not come."""
    if name in _AS_JSON:
        return {"type": "string"}
    (chosen,) = [each for each in schema.get("anyOf", [schema]) if each.get("type") != "null"]
    return {key: value for key, value in chosen.items() if key not in ("title", "description", "x-allowed", "default")}


def _schemas() -> dict[str, dict[str, Any]]:
    return {name: _plain(name, schema) for name, schema in _PROPERTIES.items()}


def _described(schema: dict[str, Any]) -> str:
    """With the default. Stated as such, generated clients would send it twice: in the query and in the form."""
    usual = f" Without it, `{schema['default']}`." if schema.get("default") else ""
    return f"{schema['description']}{usual}"


def _openapi() -> dict[str, Any]:
    """FastAPI reads no form here, so it cannot describe it either."""
    described = {name: {"description": _described(each)} for name, each in _PROPERTIES.items()}
    schemas = _schemas()
    in_form = {name: schemas[name] | described[name] for name in _PROPERTIES if name != "filename"}
    binary = {"type": "string", "format": "binary"}
    form = {"type": "object", "required": [FILE_PART], "properties": {FILE_PART: binary, **in_form}}
    return {
        "parameters": [
            {"name": name, "in": "query", "required": False, "schema": schemas[name], **described[name]}
            for name in _PROPERTIES
        ],
        "requestBody": {
            "required": True,
            "content": {
                "multipart/form-data": {"schema": form | {"additionalProperties": False}},
                "application/octet-stream": {"schema": binary},
            },
        },
    }


OPENAPI = _openapi()
"""The parameters and the body of an upload, for the OpenAPI document."""
