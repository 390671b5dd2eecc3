"""The forms of predictions and drives, in a closed table by name and media type. A new form is one file and one row.

Forms that need a large library import it on their first use: serving JSON costs neither pyarrow nor matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType

from service.wire.forms.arrow import encode_arrow
from service.wire.forms.csv import encode_csv
from service.wire.forms.html import encode_html
from service.wire.forms.json import encode_json
from service.wire.forms.npz import encode_npz
from service.wire.forms.parquet import encode_parquet
from service.wire.forms.placement import PLAIN, Placement
from service.wire.forms.plot import encode_png, encode_svg
from service.wire.forms.subject import Picture, Stage, Subject, Writable
from service.wire.forms.usda import encode_usda


class Format(StrEnum):
    """Names of the forms of a prediction or drive, as `?format=` takes them; of equal wishes the first one wins."""

    JSON = "json"
    CSV = "csv"
    NPZ = "npz"
    ARROW = "arrow"
    PARQUET = "parquet"
    USDA = "usda"
    SVG = "svg"
    PNG = "png"
    HTML = "html"


class PictureFormat(StrEnum):
    """Names of the forms of an answer that is shown rather than read in: numbers, a picture, a page."""

    JSON = "json"
    SVG = "svg"
    PNG = "png"
    HTML = "html"


class MapFormat(StrEnum):
    """Names of the forms of a mobility map."""

    JSON = "json"
    CSV = "csv"
    SVG = "svg"
    PNG = "png"
    HTML = "html"


class TableFormat(StrEnum):
    """Names of the forms of an answer that is no trajectory."""

    JSON = "json"
    CSV = "csv"


@dataclass(frozen=True, slots=True)
class Encoder:
    """How one form is written. `text` forms are UTF-8, worth compressing, and fit for a terminal.

    `points_at_once` are written in about a third of a millisecond: for no more of them the event loop itself may do it.
    """

    media_type: str
    encode: Callable[[Writable], bytes]
    text: bool
    points_at_once: int


ENCODERS: Mapping[Format, Encoder] = MappingProxyType(
    {
        Format.JSON: Encoder("application/json", encode_json, text=True, points_at_once=25_000),
        Format.CSV: Encoder("text/csv", encode_csv, text=True, points_at_once=13_000),
        Format.NPZ: Encoder("application/x-npz", encode_npz, text=False, points_at_once=25_000),
        Format.ARROW: Encoder("application/vnd.apache.arrow.stream", encode_arrow, text=False, points_at_once=25_000),
        Format.PARQUET: Encoder("application/vnd.apache.parquet", encode_parquet, text=False, points_at_once=2_000),
        Format.USDA: Encoder("model/vnd.usda", encode_usda, text=True, points_at_once=500),
        Format.SVG: Encoder("image/svg+xml", encode_svg, text=True, points_at_once=0),
        Format.PNG: Encoder("image/png", encode_png, text=False, points_at_once=0),
        Format.HTML: Encoder("text/html", encode_html, text=True, points_at_once=0),
    }
)


def written(form: Format, subject: Writable, placement: Placement = PLAIN) -> bytes:
    """The answer in a form; `placement` matters to USD alone. Raises NonFiniteError."""
    return encode_usda(subject, placement) if form is Format.USDA else ENCODERS[form].encode(subject)


MEDIA_TYPES: Mapping[Format, str] = MappingProxyType({form: each.media_type for form, each in ENCODERS.items()})
TABLE_MEDIA_TYPES: Mapping[TableFormat, str] = MappingProxyType(
    {form: MEDIA_TYPES[Format(form)] for form in TableFormat}
)
PICTURE_MEDIA_TYPES: Mapping[PictureFormat, str] = MappingProxyType(
    {form: MEDIA_TYPES[Format(form)] for form in PictureFormat}
)
MAP_MEDIA_TYPES: Mapping[MapFormat, str] = MappingProxyType({form: MEDIA_TYPES[Format(form)] for form in MapFormat})

__all__ = [
    "ENCODERS",
    "MAP_MEDIA_TYPES",
    "MEDIA_TYPES",
    "PICTURE_MEDIA_TYPES",
    "TABLE_MEDIA_TYPES",
    "Encoder",
    "Format",
    "MapFormat",
    "Picture",
    "PictureFormat",
    "Stage",
    "Subject",
    "TableFormat",
    "Writable",
    "written",
]
