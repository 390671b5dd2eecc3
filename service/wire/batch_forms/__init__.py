"""The forms of many predictions or drives, in a closed table by name and media type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from service.wire.batch_forms.arrow import encode_batch_arrow
from service.wire.batch_forms.json import encode_batch_json
from service.wire.batch_forms.ndjson import batch_lines
from service.wire.batch_forms.npz import encode_batch_npz
from service.wire.batch_forms.parquet import encode_batch_parquet
from service.wire.batch_forms.subject import BatchSubject, BatchWritable
from service.wire.batch_forms.usda import encode_batch_usda
from service.wire.forms import MEDIA_TYPES, Format
from service.wire.forms.placement import PLAIN, Placement


class BatchFormat(StrEnum):
    """Names of the forms, as `?format=` takes them; of equal wishes the first one wins."""

    JSON = "json"
    NDJSON = "ndjson"
    NPZ = "npz"
    ARROW = "arrow"
    PARQUET = "parquet"
    USDA = "usda"


@dataclass(frozen=True, slots=True)
class BatchEncoder:
    """How one form is written: whole, or, a `stream`, in chunks. `text` is worth compressing."""

    media_type: str
    encode: Callable[[BatchWritable], bytes] | None = None
    stream: Callable[[BatchWritable], Iterable[bytes]] | None = None
    text: bool = False


BATCH_ENCODERS: Mapping[BatchFormat, BatchEncoder] = MappingProxyType(
    {
        BatchFormat.JSON: BatchEncoder(MEDIA_TYPES[Format.JSON], encode_batch_json, text=True),
        BatchFormat.NDJSON: BatchEncoder("application/x-ndjson", stream=batch_lines),
        BatchFormat.NPZ: BatchEncoder(MEDIA_TYPES[Format.NPZ], encode_batch_npz),
        BatchFormat.ARROW: BatchEncoder(MEDIA_TYPES[Format.ARROW], encode_batch_arrow),
        BatchFormat.PARQUET: BatchEncoder(MEDIA_TYPES[Format.PARQUET], encode_batch_parquet),
        BatchFormat.USDA: BatchEncoder(MEDIA_TYPES[Format.USDA], encode_batch_usda, text=True),
    }
)


def batch_written(form: BatchFormat, subject: BatchWritable, placement: Placement = PLAIN) -> bytes:
    """The answer in a form that is not streamed; `placement` matters to USD alone. Raises NonFiniteError."""
    encode = BATCH_ENCODERS[form].encode
    assert encode is not None
    return encode_batch_usda(subject, placement) if form is BatchFormat.USDA else encode(subject)


BATCH_MEDIA_TYPES: Mapping[BatchFormat, str] = MappingProxyType(
    {form: each.media_type for form, each in BATCH_ENCODERS.items()}
)

__all__ = [
    "BATCH_ENCODERS",
    "BATCH_MEDIA_TYPES",
    "BatchEncoder",
    "BatchFormat",
    "BatchSubject",
    "BatchWritable",
    "batch_written",
]
