"""The wire models of what is answered. They describe and are tested; `encode_steps` writes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import orjson
from pydantic import BaseModel, ConfigDict, Field

from service.twin import Twin
from service.twin.steps import HALF_WIDTH_LEVEL, Moment, write_states
from service.wire.faults import ProblemError
from service.wire.prediction_answer import ModelIdentity
from service.wire.steps.fleet import Group, Stepped
from service.wire.steps.question import state_text

StateText = Annotated[
    str,
    Field(description="What to go on from: send it with the rover's next step, to this server or another. Opaque."),
]


class StepDomain(BaseModel):
    """Whether the rover is where the training runs of the version were."""

    inside: bool
    reasons: Annotated[
        list[str],
        Field(description="The inputs that are outside; `joint` is their combination, `horizon_s` the time so far."),
    ]


class RoverMoment(BaseModel):
    """A rover at the end of its step, in the frame of the track: x along the surface, y normal to it."""

    id: str
    state: Annotated[StateText | None, Field(description="Over `/v1/live` only on `include: [state]`.")] = None
    time_s: Annotated[float, Field(description="Since the start.")]
    x_m: Annotated[float, Field(description="Of the rear wheel's centre along the track, from where it started.")]
    y_m: Annotated[float, Field(description="Of the rear wheel's centre above the undeformed surface.")]
    speed_m_s: Annotated[float, Field(description="Along the track, positive uphill.")]
    rear_wheel_speed_rad_s: float
    front_wheel_speed_rad_s: float
    slip_ratio: Annotated[
        float,
        Field(description="(R w - v) / max(|R w|, |v|) with w the mean of both axles: 0 rolls, 1 spins on the spot."),
    ]
    x_half_width_m: Annotated[
        float | None,
        Field(
            description=f"Half the width of the band around x at level {HALF_WIDTH_LEVEL}, to first order; null for a "
            "version without doubt."
        ),
    ]
    moving: Annotated[bool, Field(description="Whether it moves, at 1 mm/s or more.")]
    domain: StepDomain


class StepError(BaseModel):
    """Why a rover was not moved on: the problem. It may have further members."""

    model_config = ConfigDict(extra="allow")

    index: Annotated[int, Field(description="Place among the rovers that were sent, from 0.")]
    id: Annotated[str | None, Field(description="As it was sent; null where it was none.")]
    type: str
    title: str
    status: int
    detail: str
    errors: list[ProblemError] | None = None


class StepsAnswer(BaseModel):
    """Rovers that were moved on, in the order sent, and why the others were not."""

    model: Annotated[ModelIdentity | None, Field(description="Who answered; null where several versions did, or none.")]
    rovers: list[RoverMoment]
    errors: list[StepError]


class MessageProblem(BaseModel):
    """What is wrong with a whole message. It may have further members."""

    model_config = ConfigDict(extra="allow")

    type: Annotated[str, Field(description="Stable URI of the kind of problem, as over HTTP.")]
    title: str
    status: int
    detail: str
    errors: list[ProblemError] | None = None


class MessageError(BaseModel):
    """The answer to a message that cannot be read or understood as a whole. Rovers that are kept stay as they are."""

    error: MessageProblem


class HandedBack(BaseModel):
    """A rover that the connection kept."""

    id: str
    state: StateText


class Parting(BaseModel):
    """The last message before the server closes: every rover's state. A step that was not answered was not made."""

    event: Annotated[
        Literal["draining", "idle"],
        Field(description="`draining`: this server ends, go on at another one. `idle`: no message came for too long."),
    ]
    rovers: list[HandedBack]


def rover_documents(group: Group, *, with_state: bool) -> list[dict[str, Any]]:
    """The rovers of one version as JSON values; a half-width that is not known is NaN, which orjson writes as null."""
    moments, twin = group.moments, group.loaded.twin
    columns = zip(
        group.ids,
        moments.time_s.tolist(),
        moments.x_m.tolist(),
        moments.y_m.tolist(),
        moments.speed_m_s.tolist(),
        moments.rear_wheel_speed_rad_s.tolist(),
        moments.front_wheel_speed_rad_s.tolist(),
        moments.slip_ratio.tolist(),
        moments.x_half_width_m.tolist(),
        moments.moving.tolist(),
        moments.outside_of,
        strict=True,
    )
    found = [_document(*row) for row in columns]
    if with_state:
        for each, state in zip(found, write_states(twin.name, twin.version, group.states), strict=True):
            each["state"] = state_text(state)
    return found


def _document(
    name: str,
    time_s: float,
    x_m: float,
    y_m: float,
    speed_m_s: float,
    rear_rad_s: float,
    front_rad_s: float,
    slip_ratio: float,
    half_width_m: float | None,
    moving: bool,
    outside_of: list[str],
) -> dict[str, Any]:
    return {
        "id": name,
        "time_s": time_s,
        "x_m": x_m,
        "y_m": y_m,
        "speed_m_s": speed_m_s,
        "rear_wheel_speed_rad_s": rear_rad_s,
        "front_wheel_speed_rad_s": front_rad_s,
        "slip_ratio": slip_ratio,
        "x_half_width_m": half_width_m,
        "moving": moving,
        "domain": {"inside": not outside_of, "reasons": outside_of},
    }


def encode_one(name: str, twin: Twin, moment: Moment) -> bytes:
    """What `encode_steps` writes of one rover that went on, without its state. orjson writes NaN as null."""
    model = {"name": twin.name, "version": twin.version, "alias": None}
    return orjson.dumps({"model": model, "rovers": [_document(name, *moment[:-1])], "errors": []})


def encode_steps(stepped: Stepped, errors: Sequence[Mapping[str, Any]], *, with_state: bool) -> bytes:
    """The JSON of an answer; `errors` are the problems of the rovers that were not moved on, in order."""
    rovers: list[dict[str, Any]] = []
    for group in stepped.groups:
        rovers += rover_documents(group, with_state=with_state)
    if len(stepped.groups) > 1:
        places = [place for group in stepped.groups for place in group.places]
        rovers = [rovers[at] for at in sorted(range(len(places)), key=places.__getitem__)]
    return orjson.dumps({"model": stepped.identity(), "rovers": rovers, "errors": errors})
