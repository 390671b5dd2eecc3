"""What a person says of how runs were recorded: in which frame, of which point, from which moment on."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from service.errors import InvalidValueError

FIRST_ROW = "first-row"
START_WORDS = f"{FIRST_ROW}, or a time in seconds (at most 1e10, as clocks count since 1970)"


def stamp(time_s: float) -> str:
    """A time stamp with all of its digits down to a microsecond, as `--start` takes it."""
    text = f"{time_s:.6f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


class Frame(StrEnum):
    """The frame that positions are given in. "Downhill" says that x grows downhill."""

    SLOPE = "slope"
    SLOPE_DOWNHILL = "slope-downhill"
    WORLD = "world"
    WORLD_DOWNHILL = "world-downhill"

    @property
    def is_world(self) -> bool:
        """Whether x is horizontal and the other coordinate vertical, upwards."""
        return self in (Frame.WORLD, Frame.WORLD_DOWNHILL)

    @property
    def is_reversed(self) -> bool:
        """Whether x grows downhill."""
        return self in (Frame.SLOPE_DOWNHILL, Frame.WORLD_DOWNHILL)


class Reference(StrEnum):
    """The point of the rover whose positions the columns rear_x_m and rear_y_m hold."""

    REAR_WHEEL = "rear-wheel"
    FRONT_WHEEL = "front-wheel"
    CHASSIS = "chassis"


def _as_start(value: object) -> object:
    """A number out of a text; anything else is left to be judged."""
    if not isinstance(value, str) or value == FIRST_ROW:
        return value
    try:
        return float(value)
    except ValueError:
        return value


Start = Annotated[Literal["first-row"] | Annotated[float, Field(ge=-1e10, le=1e10)], BeforeValidator(_as_start)]
"""The time stamp at which the motors were switched on, s, or that of the first row."""


class Alignment(BaseModel):
    """What was said of frame, point and start. None: nothing, which means slope frame, rear wheel, time from zero."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    frame: Frame | None = None
    reference: Reference | None = None
    start: Start | None = None

    @classmethod
    def said(cls, **words: str | float | None) -> Alignment:
        """From options. Raises InvalidValueError for a word that is not one."""
        try:
            return cls.model_validate(words)
        except ValidationError as error:
            field = str(error.errors()[0]["loc"][0])
            raise InvalidValueError(field, words.get(field), ALLOWED.get(field, ", ".join(ALLOWED))) from error

    def over(self, other: Alignment) -> Alignment:
        """What is said here, and what the other one says where nothing is said here."""
        return Alignment.model_validate({**other.words(), **self.words()})

    def words(self) -> Mapping[str, Any]:
        """What was said, by field."""
        return self.model_dump(exclude_none=True)

    @property
    def is_of_front(self) -> bool:
        """Whether positions are those of the front wheel."""
        return self.reference is Reference.FRONT_WHEEL

    def at(self, time_s: float) -> str:
        """How to say that the motors were switched on at this time stamp."""
        return f"--start {stamp(time_s)}"


ALLOWED = {
    "frame": f"one of {', '.join(Frame)}",
    "reference": f"one of {', '.join(Reference)}",
    "start": START_WORDS,
}
NOTHING_SAID = Alignment()
