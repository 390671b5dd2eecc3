"""Bodies of the protocol: JSON, or JSON followed by the tensors' bytes (extension `binary_tensor_data`)."""

from __future__ import annotations

import sys
import zlib
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from fastapi import HTTPException, Response
from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, ValidationError
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails

from service.api.http.answers.written import Written
from service.api.http.exceptions import BodyTooLargeError, UnsupportedMediaTypeError
from service.api.http.reading import parsed
from service.api.v2.signature import Values
from service.wire.faults import MAX_FAULTS, InputFault, InvalidInputError, fault
from service.wire.forms.numbers import column_text, dump_finite

HEADER_LENGTH = "Inference-Header-Content-Length"
_GZIP_OR_ZLIB = 32 + zlib.MAX_WBITS  # zlib tells the two apart by their first bytes

# marks of byte order that are little-endian here
_LITTLE = "<|=" if sys.byteorder == "little" else "<|"

Parameters = dict[str, str | bool | int | float]
_WITH_PARAMETERS = "an object of texts, numbers, true or false"


class _Part(BaseModel):
    """Some clients write null where they have nothing to say: `request_of` takes it away."""

    model_config = ConfigDict(strict=True, allow_inf_nan=False)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """What may be left out may be null as well."""
        schema = handler(core)
        told = handler.resolve_ref_schema(schema)
        for name, member in told["properties"].items():
            if name not in told.get("required", ()) and "anyOf" not in member:
                told["properties"][name] = {"anyOf": [member, {"type": "null"}]}
        return schema


class RequestedInput(_Part):
    """One input tensor: its values stand in `data`, or in the body's binary part."""

    name: str
    shape: Annotated[list[Annotated[int, Field(ge=0)]], Field(max_length=8)]
    datatype: str
    parameters: Parameters = Field(default_factory=dict, description="`binary_data_size` for a tensor in binary.")
    data: list[Any] = Field(default_factory=list, description="Values in row-major order.")


class RequestedOutput(_Part):
    """One output tensor that is wanted."""

    name: str
    parameters: Parameters = Field(default_factory=dict, description="`binary_data` to get it in binary, or not.")


class InferenceRequest(_Part):
    """The JSON part of a request; members that the protocol does not know are ignored, as Triton does."""

    id: str | None = Field(default=None, max_length=1024, description="Comes back with the answer.")
    parameters: Parameters = Field(default_factory=dict)
    inputs: Annotated[list[RequestedInput], Field(max_length=16)]
    outputs: Annotated[list[RequestedOutput], Field(max_length=64)] = Field(default_factory=list)


_TENSOR = "an object with name, shape, datatype and data"
_ALLOWED = {
    "body": "a JSON object",
    "id": "a text of at most 1024 characters",
    "parameters": _WITH_PARAMETERS,
    "inputs": f"a list of at most 16 tensors, each {_TENSOR}",
    "inputs.name": "a text",
    "inputs.shape": "a list of at most 8 whole numbers",
    "inputs.datatype": "a text",
    "inputs.parameters": _WITH_PARAMETERS,
    "inputs.data": "a list",
    "outputs": "a list of at most 64 outputs",
    "outputs.name": "a text",
    "outputs.parameters": _WITH_PARAMETERS,
}


def unpacked(body: bytes, encoding: str, limit_bytes: int) -> bytes:
    """The body without its `Content-Encoding`.

    Raises UnsupportedMediaTypeError, BodyTooLargeError for more than `limit_bytes` (whatever it was packed to), and
    HTTPException for what cannot be unpacked.
    """
    if encoding in ("", "identity"):
        return body
    if encoding not in ("gzip", "deflate"):
        raise UnsupportedMediaTypeError(f"Content-Encoding is '{encoding[:100]}', allowed is gzip or deflate")
    unpacking = zlib.decompressobj(_GZIP_OR_ZLIB)
    try:
        content = unpacking.decompress(body, limit_bytes + 1)
    except zlib.error as error:
        raise HTTPException(400, f"it is not {encoding}") from error
    if len(content) > limit_bytes:
        raise BodyTooLargeError(limit_bytes)
    if not unpacking.eof or unpacking.unused_data:
        raise HTTPException(400, f"it is not one whole {encoding} stream")
    return content


def split(body: bytes, header_length: str | None) -> tuple[bytes, memoryview]:
    """The JSON part and the binary part. Raises HTTPException for a length that does not fit the body."""
    if header_length is None:
        return body, memoryview(b"")
    length = int(header_length) if header_length.isdecimal() and len(header_length) < 10 else -1
    if length == 0:
        raise HTTPException(400, f"{HEADER_LENGTH} is 0, which is for models with one input; these have three or more")
    if not 0 < length <= len(body):
        said = f"{HEADER_LENGTH} is '{header_length[:20]}'"
        raise HTTPException(400, f"{said}, allowed is 1 to the {len(body)} bytes of the body")
    return body[:length], memoryview(body)[length:]


def request_of(content: bytes) -> InferenceRequest:
    """The JSON part of a request. Raises MalformedBodyError and InvalidInputError."""
    sent = parsed(content, {})
    if b"null" in content:
        sent = _without_nulls(sent)
    try:
        found: InferenceRequest = InferenceRequest.__pydantic_validator__.validate_python(sent)
    except ValidationError as error:
        faults = {each.field: each for each in map(_fault, error.errors(include_url=False))}
        raise InvalidInputError(*list(faults.values())[:MAX_FAULTS]) from None
    return found


def _without_nulls(sent: Any) -> Any:  # noqa: ANN401 - whatever was sent
    """A request, and its tensors, without members that are null."""
    if not isinstance(sent, dict):
        return sent
    said = _said(sent)
    for name in ("inputs", "outputs"):
        if isinstance(said.get(name), list):
            said[name] = [_said(each) if isinstance(each, dict) else each for each in said[name]]
    return said


def _said(part: dict[str, Any]) -> dict[str, Any]:
    return {name: each for name, each in part.items() if each is not None}


def _fault(error: ErrorDetails) -> InputFault:
    place, kind = "", ""
    for part in error["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif not kind.endswith("parameters"):
            place, kind = (f"{place}.{part}", f"{kind}.{part}") if place else (part, part)
    place, allowed = place or "body", _ALLOWED.get(kind, _ALLOWED["body"])
    if error["type"] == "missing":
        return InputFault(place, None, allowed, f"{place} is missing, allowed is {allowed}")
    return fault(place, error["input"], allowed)


def response_of(document: Mapping[str, Any], outputs: Sequence[tuple[dict[str, Any], Values, bool]]) -> Response:
    """The answer: `document` with these outputs, each its description, its values and whether it goes in binary.

    All numbers are finite: who predicts has seen to it.
    """
    tail: list[bytes | memoryview] = []
    described = []
    for output, values, binary in outputs:
        if binary:
            content, size = _binary(values)
            tail.append(content)
            described.append(output | {"parameters": {"binary_data_size": size}})
        else:
            described.append(output | {"data": _in_text(output["name"], values)})
    head = dump_finite({**document, "outputs": described})
    if not tail:
        return Written(head, {"Content-Type": "application/json"})
    headers = {"Content-Type": "application/octet-stream", HEADER_LENGTH: str(len(head))}
    return Written(b"".join([head, *tail]), headers)


def _in_text(name: str, values: Values) -> object:
    """Columns over time have the digits that every text has."""
    if isinstance(values, list):
        return values
    if values.ndim == 1:
        return column_text(name, values) if name == "time_s" else _row_major(values)
    return column_text(name, _row_major(values).ravel())


def _binary(values: Values) -> tuple[bytes | memoryview, int]:
    if isinstance(values, list):
        texts = [text.encode() for text in values]
        content = b"".join(len(text).to_bytes(4, "little") + text for text in texts)
        return content, len(content)
    array = _row_major(values)
    return array.data, array.nbytes


def _row_major(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Contiguous and little-endian; not copied where it is so already."""
    if values.flags.c_contiguous and values.dtype.byteorder in _LITTLE:
        return values
    return np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
