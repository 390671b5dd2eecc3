"""What a client sends to move rovers on: rovers, each of which may be wrong, and which model is to answer."""

from __future__ import annotations

import binascii
from collections import defaultdict
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.json_schema import SkipJsonSchema

from service.allowed import Words
from service.physics.scenario import Array
from service.settings import LIMITS, Settings
from service.wire.faults import InputFault, InvalidInputError, fault, faults_of, missing, strangers_in, unknown_field
from service.wire.prediction import PredictionInputs

MAX_ROVERS = 10_000
MOST_SECONDS = 24_000.0
"""Of the steps of one message, all rovers together: about a second of arithmetic."""

MOST_START_SPEED_M_S = 5.0
LONGEST_ID = 100
_LONGEST_STATE = 8192
_STATE = "a state as a step answered it"
_MODEL = PredictionInputs.model_fields["model"]


def _without_null(schema: dict[str, Any]) -> None:
    """Null is taken for a field that is not there; nobody need know."""
    kept = [each for each in schema.pop("anyOf", []) if each.get("type") != "null"]
    schema.update(kept[0] if kept else {})
    schema.pop("default", None)


class RoverStart(BaseModel):
    """A rover that begins to move, at x = 0 and time 0."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    mass_kg: Annotated[
        float, Field(ge=LIMITS.mass_kg[0], le=LIMITS.mass_kg[1], description="Mass of the rover in kg.", examples=[430])
    ]
    start_speed_m_s: Annotated[
        Annotated[float, Field(ge=-MOST_START_SPEED_M_S, le=MOST_START_SPEED_M_S)] | None,
        Field(
            json_schema_extra=_without_null,
            description="Speed along the slope; without it the rover is parked, and let go.",
        ),
    ] = None


class RoverStep(BaseModel):
    """One rover's step. Controls and slope hold during all of it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)

    id: Annotated[str, Field(min_length=1, max_length=LONGEST_ID, description="Any name; comes back with the answer.")]
    state: Annotated[
        Annotated[str, Field(max_length=_LONGEST_STATE, json_schema_extra={"x-allowed": _STATE})] | None,
        Field(
            json_schema_extra=_without_null,
            description="What an earlier step answered: the rover goes on from there. Either this or `start`.",
        ),
    ] = None
    start: Annotated[
        RoverStart | None,
        Field(json_schema_extra=_without_null, description="Puts the rover to the start before this step."),
    ] = None
    slope_deg: Annotated[
        float,
        Field(
            ge=-LIMITS.slope_deg,
            le=LIMITS.slope_deg,
            description="Slope under the rover's middle in degrees; positive means that it faces uphill.",
            examples=[20],
        ),
    ]
    torque_nm: Annotated[
        Annotated[float, Field(ge=LIMITS.torque_nm[0], le=LIMITS.torque_nm[1])] | None,
        Field(
            json_schema_extra=_without_null,
            description="Stall torque of each wheel's motor; 0: wheels free. Needed unless the brake is on.",
            examples=[60],
        ),
    ] = None
    brake: Annotated[bool, Field(description="Motors off and wheels locked, whatever the torque.")] = False
    dt_s: Annotated[
        float,
        Field(
            ge=LIMITS.dt_s[0],
            le=LIMITS.dt_s[1],
            description="How long the step is, in seconds. Those of all rovers of a message last at most 24,000 s "
            "together.",
            examples=[0.1],
        ),
    ]


_step, _steps = TypeAdapter(RoverStep), TypeAdapter(list[RoverStep], config=ConfigDict(defer_build=True))
_NONE_BEFORE: frozenset[str] = frozenset()
_EXAMPLE: dict[str, Any] = {
    "rovers": [
        {"id": "a", "start": {"mass_kg": 430}, "slope_deg": 20, "torque_nm": 60, "dt_s": 0.1},
        {"id": "b", "start": {"mass_kg": 550, "start_speed_m_s": 0.2}, "slope_deg": 5, "brake": True, "dt_s": 0.1},
    ]
}


class StepsBody(BaseModel):
    """Rovers and their steps."""

    model_config = ConfigDict(extra="forbid", frozen=True, json_schema_extra={"examples": [_EXAMPLE]})

    rovers: Annotated[
        list[RoverStep],
        Field(
            min_length=1,
            max_length=MAX_ROVERS,
            description="The rovers. Refused ones are listed in `errors`; the others are moved on.",
        ),
    ]
    model: Annotated[
        Annotated[str, *_MODEL.metadata] | SkipJsonSchema[None],
        Field(
            description="Version that moves the rovers, `name`, `name@version` or `name@alias`. Without it each rover "
            "stays with the version that its state names, and new ones get the default model.",
            json_schema_extra=_MODEL.json_schema_extra,
        ),
    ] = None


class LiveBody(StepsBody):
    """What a client sends over `/v1/live`: rovers with neither `state` nor `start` go on from where they are."""

    rovers: Annotated[
        list[RoverStep],
        Field(
            max_length=Settings.model_fields["max_live_rovers"].default,
            description="The rovers. Refused ones are listed in `errors`; the others move. At most 1000 unless the "
            "operator set another limit.",
        ),
    ] = []
    include: Annotated[
        list[Literal["state"]],
        Field(max_length=8, description="`state` for the state of each rover beside the rest."),
    ] = []
    remove: Annotated[
        list[str], Field(max_length=MAX_ROVERS, description="Ids of rovers to forget, after the steps of this message.")
    ] = []


class _Shared(BaseModel):
    """What the rovers share, without them."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    model: Annotated[str, *_MODEL.metadata] | None = None
    include: Annotated[list[Literal["state"]], Field(max_length=8)] = []
    remove: Annotated[list[str], Field(max_length=MAX_ROVERS)] = []


ROVER_WORDS = Words.of(RoverStep)
"""What each field of a rover allows."""
ROVER_RANGES: Mapping[str, tuple[float, float]] = {
    "slope_deg": (-LIMITS.slope_deg, LIMITS.slope_deg),
    "torque_nm": LIMITS.torque_nm,
    "dt_s": LIMITS.dt_s,
    "mass_kg": LIMITS.mass_kg,
    "start_speed_m_s": (-MOST_START_SPEED_M_S, MOST_START_SPEED_M_S),
}
"""Lowest and highest of each number of a rover and its start."""
STEPS_WORDS = Words(
    lambda: {
        **ROVER_WORDS,
        "model": Words.of(StepsBody)["model"],
        "include": "a list with the word state",
        "remove": f"a list of at most {MAX_ROVERS} ids",
        "rovers": f"a list of 1 to {MAX_ROVERS} rovers",
    }
)
"""The same of a whole message."""


@dataclass(frozen=True, slots=True, eq=False)
class StepsQuestion:
    """What was asked of the rovers that can be: columns (rover,).

    `states` are bytes or None, `mass_kg` and `start_speed_m_s` those of starts: NaN where there is none, the speed also
    where the rover is parked. `places` are the rovers' among all that were sent; `sent_ids` are of all of these,
    `failures` says by their place what is wrong with the others. `with_state`: whether states are to be answered.
    """

    ids: Sequence[str]
    slope_deg: Array
    torque_nm: Array
    brake: npt.NDArray[np.bool_]
    dt_s: Array
    states: Sequence[bytes | None]
    mass_kg: Array
    start_speed_m_s: Array
    places: Sequence[int]
    sent_ids: Sequence[object]
    failures: Mapping[int, Exception]
    model: str | None = None
    remove: Sequence[str] = ()
    with_state: bool = True

    def __post_init__(self) -> None:
        total_s = float(self.dt_s.sum())
        if total_s > MOST_SECONDS:
            said, allowed = f"{total_s:g} s in all", f"at most {MOST_SECONDS:g} s, of all rovers together"
            raise InvalidInputError(fault("dt_s", said, allowed))

    def __len__(self) -> int:
        return len(self.ids)


def read_steps(document: object, *, live: bool = False, most: int = MAX_ROVERS) -> StepsQuestion:
    """The question in the JSON of a body or, `live`, of a message. Rovers that are wrong are among its failures.

    Raises InvalidInputError for what concerns all of them.
    """
    if not isinstance(document, dict):
        raise InvalidInputError(fault("body", document, "a JSON object"))
    known = ("rovers", "model", "include", "remove") if live else ("rovers", "model")
    if strangers := [name for name in document if name not in known]:
        allowed = "one of " + ", ".join(known)
        raise InvalidInputError(*(unknown_field(name, document[name], allowed) for name in strangers[:20]))
    sent, least = document.get("rovers", [] if live else None), 0 if live else 1
    if not isinstance(sent, list) or not least <= len(sent) <= most:
        said = f"{len(sent)} rovers" if isinstance(sent, list) else sent
        allowed = f"a list of {least} to {most} rovers"
        raise InvalidInputError(fault("rovers", said, allowed) if "rovers" in document else missing("rovers", allowed))
    if document.get("model", "") is None:
        raise InvalidInputError(fault("model", None, STEPS_WORDS["model"]))
    shared = _SAME if document.keys() == {"rovers"} else _read_shared(document)
    good, failures = _checked(sent, live=live)
    rovers, states = [], []
    for at, rover in list(good.items()):
        state = None
        if rover.state is not None:
            try:
                state = binascii.a2b_base64(rover.state, strict_mode=True)
            except ValueError:
                failures[at] = wrong_state(rover.state, "this is not the state of a rover")
                del good[at]
                continue
        rovers.append(rover)
        states.append(state)
    starts = [each.start for each in rovers]
    return StepsQuestion(
        ids=[each.id for each in rovers],
        slope_deg=np.array([each.slope_deg for each in rovers], dtype=np.float64),
        torque_nm=np.array([each.torque_nm or 0.0 for each in rovers], dtype=np.float64),
        brake=np.array([each.brake for each in rovers], dtype=np.bool_),
        dt_s=np.array([each.dt_s for each in rovers], dtype=np.float64),
        states=states,
        mass_kg=np.array([np.nan if each is None else each.mass_kg for each in starts]),
        start_speed_m_s=np.array(
            [np.nan if each is None or each.start_speed_m_s is None else each.start_speed_m_s for each in starts]
        ),
        places=list(good),
        sent_ids=[each.get("id") if isinstance(each, dict) else None for each in sent],
        failures=failures,
        model=shared.model,
        remove=shared.remove,
        with_state=not live or "state" in shared.include,
    )


def read_one(document: object) -> RoverStep | None:
    """The rover of a live message that is nothing but one rover that goes on; None for every other message."""
    if not isinstance(document, dict) or len(document) != 1:
        return None
    sent = document.get("rovers")
    if not isinstance(sent, list) or len(sent) != 1:
        return None
    try:
        rover = _step.validate_python(sent[0])
    except ValidationError:
        return None
    if rover.state is not None or rover.start is not None or _wrong_together(rover, _NONE_BEFORE, live=True):
        return None
    return rover


def checked_model(reference: str) -> str:
    """A reference to a model as it came from elsewhere than JSON. Raises InvalidInputError."""
    return _read_shared({"model": reference}).model or ""


def why_refused(rover: dict[str, Any], known: set[str]) -> InvalidInputError:
    """What is wrong with one rover that cannot be; `known` are the ids of those before it."""
    good, failures = _checked([rover], live=False)
    if failures:
        return failures[0]
    if good[0].id in known:
        return InvalidInputError(_wrong_together(good[0], known, live=False) or _none(rover))
    return InvalidInputError(fault("start", {}, "nothing beside a state: a rover begins or goes on"))


def state_text(state: bytes) -> str:
    """A state as text."""
    return binascii.b2a_base64(state, newline=False).decode("ascii")


def wrong_state(state: str, why: str) -> InvalidInputError:
    """What is wrong with a state."""
    allowed = ROVER_WORDS["state"]
    return InvalidInputError(InputFault("state", state, allowed, f"state cannot be continued: {why}"))


_SAME = _Shared()


def _read_shared(document: Mapping[str, Any]) -> _Shared:
    try:
        return _Shared.model_validate({name: document[name] for name in document if name != "rovers"})
    except ValidationError as error:
        errors = [{**each, "loc": ("body", *each["loc"])} for each in error.errors(include_url=False)]
        raise InvalidInputError(*faults_of(errors, STEPS_WORDS)) from error


def _checked(sent: list[Any], *, live: bool) -> tuple[dict[int, RoverStep], dict[int, InvalidInputError]]:
    """The rovers that can be, by their place, and what is wrong with the others."""
    try:
        good, failures = dict(enumerate(_steps.validate_python(sent))), {}
    except ValidationError:
        failures = _failures(sent)
        left = [at for at in range(len(sent)) if at not in failures]
        good = dict(zip(left, _steps.validate_python([sent[at] for at in left]), strict=True))
    known: set[str] = set()
    for at, rover in list(good.items()):
        if (fault := _wrong_together(rover, known, live=live)) is not None:
            failures[at] = InvalidInputError(fault)
            del good[at]
        known.add(rover.id)
    return good, failures


def _failures(sent: list[Any]) -> dict[int, InvalidInputError]:
    strange = {at: strangers_in(each, ROVER_WORDS) for at, each in enumerate(sent) if isinstance(each, dict)}
    found = {at: error for at, error in strange.items() if error is not None}
    asked = [at for at in range(len(sent)) if at not in found]
    errors: dict[int, list[Any]] = defaultdict(list)
    try:
        _steps.validate_python([sent[at] for at in asked])
    except ValidationError as error:
        for each in error.errors(include_url=False):
            errors[asked[int(each["loc"][0])]].append(each)
    return found | {
        at: InvalidInputError(*(faults_of(some, ROVER_WORDS) if isinstance(sent[at], dict) else [_none(sent[at])]))
        for at, some in errors.items()
    }


def _none(value: object) -> InputFault:
    return fault("rover", value, "a JSON object with " + ", ".join(RoverStep.model_fields))


def _is_text(name: str) -> bool:
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _wrong_together(rover: RoverStep, known: Set[str], *, live: bool) -> InputFault | None:
    """What is wrong between fields that are right one by one."""
    if rover.id in known:
        return fault("id", rover.id, "an id of its own for each rover")
    if not rover.id.isascii() and not _is_text(rover.id):
        return fault("id", rover.id, "text that UTF-8 can hold: no lone surrogates")
    if rover.torque_nm is None and not rover.brake:
        allowed = ROVER_WORDS["torque_nm"]
        return InputFault("torque_nm", None, allowed, f"torque_nm is missing and no brake is on, allowed is {allowed}")
    if rover.state is None and rover.start is None and not live:
        allowed = ROVER_WORDS["state"]
        return InputFault("state", None, allowed, f"neither state nor start is there; state allows {allowed}")
    return None
