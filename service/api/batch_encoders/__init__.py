"""The forms of many predictions, in a closed table by name and media type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

import mimeparse

from service.api.batch_encoders.arrow import encode_batch_arrow
from service.api.batch_encoders.json import encode_batch_json
from service.api.batch_encoders.ndjson import batch_lines
from service.api.batch_encoders.npz import encode_batch_npz
from service.api.batch_encoders.subject import BatchSubject
from service.api.encoders import MEDIA_TYPES
from service.api.negotiation import NotAcceptableError


class BatchFormat(StrEnum):
    """Names of the forms, as `?format=` takes them; of equal wishes the first one wins."""

    JSON = "json"
    NDJSON = "ndjson"
    NPZ = "npz"
    ARROW = "arrow"


@dataclass(frozen=True, slots=True)
class BatchEncoder:
    """How one form is written: whole, or, a `stream`, in chunks. `text` is worth compressing."""

    media_type: str
    encode: Callable[[BatchSubject], bytes] | None = None
    stream: Callable[[BatchSubject], Iterable[bytes]] | None = None
    text: bool = False


BATCH_ENCODERS: Mapping[BatchFormat, BatchEncoder] = MappingProxyType(
    {
        BatchFormat.JSON: BatchEncoder(MEDIA_TYPES["json"], encode_batch_json, text=True),
        BatchFormat.NDJSON: BatchEncoder("application/x-ndjson", stream=batch_lines),
        BatchFormat.NPZ: BatchEncoder(MEDIA_TYPES["npz"], encode_batch_npz),
        BatchFormat.ARROW: BatchEncoder(MEDIA_TYPES["arrow"], encode_batch_arrow),
    }
)
# mimeparse wants increasing desirability: of equal wishes the last one wins
_FORMS = {BATCH_ENCODERS[form].media_type: form for form in reversed(BatchFormat)}


def choose_batch_format(asked: BatchFormat | None, accept: str | None) -> BatchFormat:
    """The form to answer in; without a wish JSON.

    Raises NotAcceptableError when `accept` rules out all of them or cannot be read.
    """
    if asked is not None or not accept or accept.isspace():
        return asked or BatchFormat.JSON
    try:
        best: str = mimeparse.best_match(list(_FORMS), accept.lower())
    except mimeparse.MimeTypeParseException:
        best = ""
    if best not in _FORMS:
        raise NotAcceptableError(f"Accept is '{accept[:100]}', available are {', '.join(reversed(_FORMS))}")
    return _FORMS[best]


__all__ = ["BATCH_ENCODERS", "BatchEncoder", "BatchFormat", "BatchSubject", "choose_batch_format"]
