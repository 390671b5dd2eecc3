"""The forms of one prediction, in a closed table by name and media type. A new form is one file and one row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from service.api.encoders.csv import encode_csv, header_fields
from service.api.encoders.json import encode_json
from service.api.encoders.subject import Subject


class Format(StrEnum):
    """Names of the forms, as `?format=` takes them."""

    JSON = "json"
    CSV = "csv"


@dataclass(frozen=True, slots=True)
class Encoder:
    """How one form is written; `headers` gives the response headers that say what the body cannot."""

    media_type: str
    encode: Callable[[Subject], bytes]
    headers: Callable[[Subject], dict[str, str]]


ENCODERS = {
    Format.JSON: Encoder("application/json", encode_json, header_fields),
    Format.CSV: Encoder("text/csv", encode_csv, header_fields),
}

__all__ = ["ENCODERS", "Encoder", "Format", "Subject"]
