"""The forms of questions and answers of steps, by name and media type."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

from service.wire.forms import MEDIA_TYPES, Format


class StepsFormat(StrEnum):
    """Names of the forms, as `?format=` takes them; of equal wishes the first one wins."""

    JSON = "json"
    ARROW = "arrow"


STEPS_MEDIA_TYPES: Mapping[StepsFormat, str] = MappingProxyType(
    {StepsFormat.JSON: MEDIA_TYPES[Format.JSON], StepsFormat.ARROW: MEDIA_TYPES[Format.ARROW]}
)
