"""The store's JSON documents: strict when written, bounded and checked when read.

A reader tolerates and keeps unknown fields, and refuses unknown major format versions. NaN, infinities and broken
Unicode are refused both ways: JSON has no words for them and the next reader would choke.
"""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, JsonValue, SkipValidation, ValidationError

from model_store.backend import Backend
from model_store.errors import CorruptArtefactError, InvalidDraftError, UnsupportedFormatError

MAX_DOCUMENT_BYTES = 8 << 20  # a manifest has some 1,300 bytes for each training run
MAX_DEPTH = 64
FORMAT_VERSION = "1.0"
"""The version all three kinds of documents are written in now; readers accept any `1.x`."""

_SUPPORTED_MAJOR = "1"
_REMEDY = "restore it from a backup, or publish anew"


class Document(BaseModel):
    """A stored JSON object. Immutable; fields this release does not know are kept as they are."""

    model_config = ConfigDict(extra="allow", frozen=True)

    format: str
    format_version: str = FORMAT_VERSION


DocumentT = TypeVar("DocumentT", bound=Document)


def flaw(value: object) -> str | None:
    """Say what in a JSON value cannot be stored, and where in it; None when all is well."""
    found = _flaw(value, 0)
    return None if found is None else f"'{found[0].removeprefix('.')[:200]}' {found[1]}"


def _flaw(value: object, depth: int) -> tuple[str, str] | None:
    """Where the first flaw is, seen from this value, and what it is. The way there is put together on the way back."""
    if depth > MAX_DEPTH:
        return "", f"is nested deeper than {MAX_DEPTH} levels"
    if isinstance(value, float):
        return None if math.isfinite(value) else ("", f"is {value}, not a finite number")
    if isinstance(value, str):
        return None if _is_text(value) else ("", "holds broken Unicode")
    if isinstance(value, dict):
        for key, inner in value.items():
            if not _is_text(str(key)):
                return "", "has a key of broken Unicode"
            if found := _flaw(inner, depth + 1):
                return f".{key}{found[0]}", found[1]
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            if found := _flaw(inner, depth + 1):
                return f"[{index}]{found[0]}", found[1]
    return None


def _is_text(text: str) -> bool:
    if text.isascii():  # almost all are, and this is the quicker question
        return True
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _flawless(value: Any) -> Any:  # noqa: ANN401 - hands through whatever pydantic gives it
    if (found := flaw(value)) is not None:
        raise ValueError(found)
    return value


def _to_utc(moment: datetime) -> datetime:
    return moment.astimezone(UTC)


Json = Annotated[JsonValue, AfterValidator(_flawless)]
"""Any JSON value; NaN and infinities refused."""

JsonObject = dict[str, SkipValidation[JsonValue]]
"""A JSON object in a document; its meaning belongs to somebody else. Each comes from a draft or from bytes, and either
was checked whole, so pydantic need not look at every value again."""

JsonObjectDraft = Annotated[dict[str, JsonValue], AfterValidator(_flawless)]
"""A JSON object in a draft; NaN and infinities refused."""

Text = Annotated[str, AfterValidator(_flawless)]

Moment = Annotated[AwareDatetime, AfterValidator(_to_utc)]
"""A time with its zone, normalised to UTC."""


def render(document: Document) -> bytes:
    """Write a document as indented JSON in UTF-8.

    Raises:
        InvalidDraftError: it would be larger than 8 MiB, or holds what JSON cannot.
    """
    try:
        text = json.dumps(document.model_dump(mode="json"), indent=2, ensure_ascii=False, allow_nan=False)
        data = f"{text}\n".encode()
    except ValueError as error:
        raise InvalidDraftError(f"the {document.format} cannot be written as JSON: {error}") from error
    if len(data) > MAX_DOCUMENT_BYTES:
        raise InvalidDraftError(
            f"the {document.format} has {len(data)} bytes, more than {MAX_DOCUMENT_BYTES}; "
            "move long tables into a report/ file"
        )
    return data


def read_document(backend: Backend, key: str, kind: type[DocumentT]) -> DocumentT | None:
    """Read, bound, parse and check one document; None when it is not there.

    Raises:
        CorruptArtefactError: too large, not JSON, not an object, another format, or a field is wrong.
        UnsupportedFormatError: its major format version is not 1.
        StoreUnavailableError: the backend fails.
    """
    data = backend.read(key, limit_bytes=MAX_DOCUMENT_BYTES)
    return None if data is None else parse_document(data, key, kind)


def parse_document(data: bytes, key: str, kind: type[DocumentT]) -> DocumentT:
    """Read a document from its bytes; `key` is named in the errors, which are those of `read_document`."""
    fields = _parse_object(data, key)
    expected = kind.model_fields["format"].default
    if fields.get("format") != expected:
        raise CorruptArtefactError(
            f"{key}: format is {str(fields.get('format'))[:80]!r}, expected {expected!r}; {_REMEDY}"
        )
    version = str(fields.get("format_version"))
    if version.partition(".")[0] != _SUPPORTED_MAJOR:
        raise UnsupportedFormatError(
            f"{key}: format_version is {version[:80]!r}, this release reads {_SUPPORTED_MAJOR}.x; "
            "upgrade the service, or publish the artefact with this release"
        )
    try:
        return kind.model_validate(fields)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        field = ".".join(str(part) for part in first["loc"])[:200]
        raise CorruptArtefactError(f"{key}: field '{field}': {first['msg']}; {_REMEDY}") from error


def _parse_object(data: bytes, key: str) -> dict[str, Any]:
    try:
        fields = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise CorruptArtefactError(f"{key} is not JSON (truncated or altered): {error}; {_REMEDY}") from error
    if not isinstance(fields, dict):
        raise CorruptArtefactError(f"{key} holds a {type(fields).__name__}, not a JSON object; {_REMEDY}")
    if (found := flaw(fields)) is not None:
        raise CorruptArtefactError(f"{key}: {found}; {_REMEDY}")
    return fields
