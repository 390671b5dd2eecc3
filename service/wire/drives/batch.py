"""What a client sends to ask for many drives at once: drives, each of which may be wrong, and what they share.

What stands beside `drives` holds for each drive that says nothing else: one track for many rovers, or the reverse.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ConfigDict, Field, ValidationError, create_model
from pydantic.fields import FieldInfo

from service.allowed import Words
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.twin.drives import DriveQuestion, Wanted
from service.wire.drives.question import WORDS, DriveSampling, OneDrive
from service.wire.faults import InvalidInputError, fault, faults_of, missing, strangers_in, unknown_field
from service.wire.points import require_few_times, require_wide_step

MOST_DRIVES = 200
MOST_SECONDS = 24_000.0
"""All horizons of a batch together: some seconds of arithmetic, with bands."""

_OF_DRIVE, _SHARED = tuple(OneDrive.model_fields), tuple(DriveSampling.model_fields)
_DRIVES = f"a list of 1 to {MOST_DRIVES} drives"
DRIVE_BATCH_WORDS = Words(lambda: {**WORDS, "drives": _DRIVES})
"""What each field of a batch allows."""

_DRIVE_WORDS = Words.of(OneDrive)


class _Drive(OneDrive):
    model_config = ConfigDict(strict=True)


class _Sampling(DriveSampling):
    model_config = ConfigDict(strict=True)


_EXAMPLE: dict[str, Any] = {
    "track": {"distance_m": [0, 3, 6, 9], "slope_deg": [10, 22, 18, 12]},
    "drives": [
        {"mass_kg": 430, "controls": 60},
        {"mass_kg": 550, "controls": 60, "until_distance_m": 8, "horizon_s": 60},
    ],
    "dt_s": 0.1,
}


def _usual(field: FieldInfo) -> tuple[Any, FieldInfo]:
    """A field of a drive that may be left out."""
    optional = copy.copy(field)
    optional.default = None
    return field.annotation, optional


_usually: dict[str, Any] = {name: _usual(field) for name, field in OneDrive.model_fields.items()}
_strict = ConfigDict(extra="forbid")
_PartOfDrive = create_model("PartOfDrive", __config__=_strict, __doc__="One of many drives.", **_usually)
_shared: dict[str, Any] = {name: (field.annotation, field) for name, field in DriveSampling.model_fields.items()}
DriveBatchBody = create_model(
    "DriveBatchBody",
    __config__=ConfigDict(extra="forbid", json_schema_extra={"examples": [_EXAMPLE]}),
    __doc__="Many drives, and the fields that they share.",
    drives=(
        list[_PartOfDrive],
        Field(
            min_length=1,
            max_length=MOST_DRIVES,
            description="The drives, each with fields of its own or those beside. Refused ones are listed in `errors`; "
            "the others are answered.",
        ),
    ),
    **_usually,
    **_shared,
)
"""The body as the OpenAPI document shows it; `read_drives` reads it."""


@dataclass(frozen=True, slots=True, eq=False)
class DrivesQuestion:
    """What was asked: drives by their place among all that were sent, what is wrong with others, what they share."""

    shared: DriveSampling
    wanted: Wanted
    drives: Mapping[int, DriveQuestion]
    failures: Mapping[int, Exception]


def read_drives(document: object, max_points: int) -> DrivesQuestion:
    """The question in the JSON of a body. Drives that are wrong, or have too many points, are among its failures.

    Raises InvalidInputError and InvalidValueError for what concerns all of them.
    """
    if not isinstance(document, dict):
        raise InvalidInputError(fault("body", document, "a JSON object"))
    known = ("drives", *_OF_DRIVE, *_SHARED)
    if strangers := [name for name in document if name not in known]:
        allowed = "one of " + ", ".join(known)
        raise InvalidInputError(*(unknown_field(name, document[name], allowed) for name in strangers[:20]))
    if "drives" not in document:
        raise InvalidInputError(missing("drives", _DRIVES))
    sent = document["drives"]
    if not isinstance(sent, list) or not 1 <= len(sent) <= MOST_DRIVES:
        said = f"{len(sent)} drives" if isinstance(sent, list) else sent
        raise InvalidInputError(fault("drives", said, _DRIVES))
    try:
        shared = _Sampling.model_validate({name: document[name] for name in _SHARED if name in document})
    except ValidationError as error:
        raise _refused(error, DRIVE_BATCH_WORDS) from error
    times = shared.own_times()
    if times is not None:
        require_few_times(len(times), len(sent), max_points)
    usual = {name: document[name] for name in _OF_DRIVE if name in document}
    drives: dict[int, DriveQuestion] = {}
    failures: dict[int, Exception] = {}
    for at, each in enumerate(sent):
        try:
            drives[at] = _question(each, usual, shared, times, (len(sent), max_points))
        except (InvalidInputError, InvalidValueError) as error:
            failures[at] = error
    seconds = sum(each.horizon_s for each in drives.values())
    if seconds > MOST_SECONDS:
        raise InvalidValueError("drives", f"{seconds:g} s of horizon_s in all", f"at most {MOST_SECONDS:g} s in all")
    return DrivesQuestion(shared, shared.wanted(times), drives, failures)


def _question(
    sent: object, usual: Mapping[str, object], shared: DriveSampling, times_s: Array | None, limits: tuple[int, int]
) -> DriveQuestion:
    if not isinstance(sent, dict):
        raise InvalidInputError(fault("drive", sent, "a JSON object with " + ", ".join(_OF_DRIVE)))
    if (strange := strangers_in(sent, _DRIVE_WORDS)) is not None:
        raise strange
    try:
        one = _Drive.model_validate({**usual, **sent})
    except ValidationError as error:
        raise _refused(error, _DRIVE_WORDS) from error
    if times_s is None:
        require_wide_step(one.longest_s(None), shared.dt_s, *limits)
    return one.question(times_s)


def _refused(error: ValidationError, words: Mapping[str, str]) -> InvalidInputError:
    errors = [{**each, "loc": ("body", *each["loc"])} for each in error.errors(include_url=False)]
    return InvalidInputError(*faults_of(errors, words))
