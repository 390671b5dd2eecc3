"""What a JSON schema allows, in a few words for error messages: "-45 to 45", "one of json, csv"."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import BaseModel

_KINDS = {
    "string": "text",
    "boolean": "true or false",
    "integer": "a whole number",
    "number": "a number",
    "array": "a list",
    "object": "a JSON object",
}


class Words(Mapping[str, str]):
    """What each field allows, found out when it is first looked at: a service that starts has no fault to tell."""

    def __init__(self, find: Callable[[], Mapping[str, str]]) -> None:
        self._find = find

    @classmethod
    def of(cls, model: type[BaseModel]) -> Words:
        """Those of a model."""
        return cls(lambda: allowed_fields(model.model_json_schema()))

    @cached_property
    def _found(self) -> Mapping[str, str]:
        return self._find()

    def __getitem__(self, field: str) -> str:
        return self._found[field]

    def __iter__(self) -> Iterator[str]:
        return iter(self._found)

    def __len__(self) -> int:
        return len(self._found)


def allowed_fields(schema: Mapping[str, Any]) -> dict[str, str]:
    """What each field of a model's JSON schema accepts; fields of fields by dotted names beside the whole."""
    return dict(_fields_of(schema, schema.get("$defs", {}), ""))


def _fields_of(schema: Mapping[str, Any], definitions: Mapping[str, Any], before: str) -> Iterator[tuple[str, str]]:
    for name, field in schema.get("properties", {}).items():
        node = _resolved(field, definitions)
        yield before + name, allowed_values(node)
        for part in (node, *node.get("anyOf", ())):
            yield from _fields_of(part, definitions, f"{before}{name}.")


def _resolved(node: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    """The node with the definitions that it, its items and its choices refer to."""
    found = {**definitions.get(str(node.get("$ref", "")).rpartition("/")[2], {}), **node}
    if "items" in found:
        found["items"] = _resolved(found["items"], definitions)
    if "anyOf" in found:
        found["anyOf"] = [_resolved(part, definitions) for part in found["anyOf"]]
    return found


def allowed_values(schema: Mapping[str, Any]) -> str:
    """The values that one property's schema accepts. `schema` has its references resolved already."""
    if isinstance(written := schema.get("x-allowed"), str):
        return written
    if "anyOf" in schema:
        return " or ".join(allowed_values(part) for part in schema["anyOf"] if part.get("type") != "null")
    if "const" in schema:
        return str(schema["const"])
    if "enum" in schema:
        values = [str(value) for value in schema["enum"]]
        return values[0] if len(values) == 1 else "one of " + ", ".join(values)
    kind = schema.get("type", "")
    if kind in ("number", "integer"):
        return _interval(schema, _KINDS[kind])
    if kind == "array" and "enum" in schema.get("items", {}):
        return "a list with any of " + ", ".join(str(value) for value in schema["items"]["enum"])
    if kind == "array" and "items" in schema:
        return f"a list of {allowed_values(schema['items'])}"
    if kind == "string" and "maxLength" in schema:
        lowest = schema.get("minLength", 0)
        return f"text of {f'{lowest} to' if lowest else 'at most'} {schema['maxLength']} characters"
    return _KINDS.get(kind, "another value")


def _interval(schema: Mapping[str, Any], kind: str) -> str:
    if kind == _KINDS["integer"] and "minimum" in schema and "maximum" in schema:
        return f"{kind} from {schema['minimum']} to {schema['maximum']}"
    lowest = schema.get("minimum", schema.get("exclusiveMinimum"))
    highest = schema.get("maximum", schema.get("exclusiveMaximum"))
    if lowest is None and highest is None:
        return kind
    above = f"more than {lowest:g}" if "exclusiveMinimum" in schema else f"{lowest:g}" if lowest is not None else None
    below = (
        f"less than {highest:g}" if "exclusiveMaximum" in schema else f"{highest:.12g}" if highest is not None else None
    )
    if above is None:
        return f"at most {below}"
    if below is None:
        return above if "exclusiveMinimum" in schema else f"at least {above}"
    return f"{above} to {below}"
