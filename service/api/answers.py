"""The wire models of answers. They describe and are tested; predictions are written by `service.api.encoders`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from service.twin import Frame, Outcome

Metres = Annotated[list[float], Field(description="Metres, one per time.")]


class ModelIdentity(BaseModel):
    """Which version answered."""

    name: str
    version: int
    alias: Annotated[str | None, Field(description="The alias it was asked for by; null when asked for by number.")]


class ScenarioEcho(BaseModel):
    """The question as understood, defaults filled in."""

    slope_deg: float
    mass_kg: float
    torque_nm: Annotated[float, Field(description="Motor stall torque per wheel.")]
    horizon_s: float


class SlopeTrajectory(BaseModel):
    """Positions of the rear wheel's centre along and normal to the slope."""

    time_s: Annotated[list[float], Field(description="Seconds from rest, rising; the last one is the horizon.")]
    x_m: Metres
    y_m: Metres


class WorldTrajectory(BaseModel):
    """Positions of the rear wheel's centre, horizontal and up."""

    time_s: Annotated[list[float], Field(description="Seconds from rest, rising; the last one is the horizon.")]
    x_m: Metres
    z_m: Metres


class SlopePrior(BaseModel):
    """The closed-form solution alone, at the same times."""

    name: str
    x_m: Metres
    y_m: Metres


class WorldPrior(BaseModel):
    """The closed-form solution alone, at the same times."""

    name: str
    x_m: Metres
    z_m: Metres


class DomainReason(BaseModel):
    """One input outside the training runs. `torque_ratio` is torque / (mass x gravity x wheel radius)."""

    field: Literal["slope_deg", "mass_kg", "torque_nm", "torque_ratio", "horizon_s"]
    value: float
    lowest: float
    highest: float
    detail: str


class DomainAnswer(BaseModel):
    """Whether the scenario lies among the runs that the version was trained on."""

    inside: bool
    reasons: list[DomainReason]


class SummaryAnswer(BaseModel):
    """The trajectory in six numbers, in the slope frame whatever `frame` is."""

    outcome: Outcome
    final_x_m: float
    final_y_m: float
    distance_m: Annotated[float, Field(ge=0, description="Length of the path.")]
    mean_speed_m_s: Annotated[float, Field(description="Along the slope; negative downhill.")]
    slip_ratio: Annotated[
        float | None, Field(description="1 - speed / (wheel radius x wheel speed); null where wheels stand still.")
    ]


class PredictionAnswer(BaseModel):
    """One prediction."""

    model: ModelIdentity
    scenario: ScenarioEcho
    frame: Frame
    trajectory: SlopeTrajectory | WorldTrajectory
    prior: Annotated[SlopePrior | WorldPrior | None, Field(description="Only on `include=prior`.")] = None
    domain: DomainAnswer
    summary: SummaryAnswer


class ModelEntry(BaseModel):
    """A model with its published versions, rising, and the version that each alias points to.

    `unreadable` says why the aliases of a model with a damaged record are not shown; null when all is well.
    """

    name: str
    versions: list[int]
    aliases: dict[str, int]
    unreadable: str | None = None


class ModelAnswer(ModelEntry):
    """The same with what the publisher said about the champion, or about the newest version without one."""

    description: str


class ModelsAnswer(BaseModel):
    """All models."""

    models: list[ModelEntry]


class AliasAnswer(BaseModel):
    """Where an alias points, since when, by whom and why."""

    version: int
    seq: Annotated[int, Field(ge=1, description="Number of this move; rises by one with each.")]
    time: datetime
    actor: str
    reason: str


class AliasesAnswer(BaseModel):
    """All aliases of a model."""

    aliases: dict[str, AliasAnswer]


class AliasHistoryAnswer(BaseModel):
    """Every move of an alias, newest first."""

    history: list[AliasAnswer]


class LiveAnswer(BaseModel):
    """The process answers."""

    status: Literal["alive"] = "alive"


class Probe(BaseModel):
    """The prediction that proved readiness."""

    final_x_m: float
    compute_ms: float


class LoadFailure(BaseModel):
    """A model reference that cannot be loaded or brought up to date."""

    reference: str
    message: str


class ReadyAnswer(BaseModel):
    """The default model has just made a prediction."""

    status: Literal["ready"] = "ready"
    model: ModelIdentity
    probe: Probe
    failures: list[LoadFailure]


class ProblemError(BaseModel):
    """What is wrong with one field."""

    field: str
    value: Annotated[Any, Field(description="What was sent; long texts are cut, NaN is written as text.")]
    allowed: str
    message: str


class Problem(BaseModel):
    """An RFC 9457 problem."""

    type: Annotated[str, Field(description="Stable URI of the kind of problem.", pattern="^urn:rover-twin:problem:")]
    title: str
    status: int
    detail: Annotated[str, Field(description="What happened here, in one line.")]
    instance: Annotated[str, Field(description="Path of the request.")]
    errors: Annotated[list[ProblemError], Field(description="Only with invalid-input and outside-domain.")] = []
    domain: Annotated[DomainAnswer | None, Field(description="Only with outside-domain.")] = None
    error: Annotated[str, Field(description="The same text as `detail`.")]
