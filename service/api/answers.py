"""The wire models of answers. They describe and are tested; predictions are written by `service.api.encoders`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from service.api.dataset_answers import DatasetUsers, ReportAnswer
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


class BandAnswer(BaseModel):
    """An interval for x and one for y at each time, slope frame: of runs like the training runs, a share of `level` of
    all times lies inside.
    """

    level: Annotated[float, Field(ge=0.5, le=0.99)]
    x_lower_m: Metres
    x_upper_m: Metres
    y_lower_m: Metres
    y_upper_m: Metres


class DomainReason(BaseModel):
    """One input outside the training runs. `torque_ratio` is torque / (mass x gravity x wheel radius).

    `joint` is no input: its value is `distance`, its highest value the 99 % quantile of what separates a training run
    from the nearest other one.
    """

    field: Literal["slope_deg", "mass_kg", "torque_nm", "torque_ratio", "horizon_s", "joint"]
    value: float
    lowest: float
    highest: float
    detail: str


class NearestRun(BaseModel):
    """A training run near the scenario, and how far off its end was predicted by a model that had not seen it."""

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    held_out_final_error_m: Annotated[float | None, Field(ge=0, description="null when it was not measured.")]
    distance: Annotated[float, Field(ge=0, description="In spreads of the training runs.")]


class DomainAnswer(BaseModel):
    """Whether the scenario lies among the runs that the version was trained on."""

    inside: bool
    reasons: list[DomainReason]
    distance: Annotated[
        float | None,
        Field(
            ge=0,
            description="Distance to the nearest training run: root of the sum of squared differences in slope, "
            "log torque_ratio and log mass, each over its spread among the runs. null for a version that does not "
            "know its runs.",
        ),
    ]
    nearest_runs: Annotated[list[NearestRun], Field(description="The three nearest training runs, nearest first.")]


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
    band: Annotated[BandAnswer | None, Field(description="Only on `include=band`.")] = None
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
    errors: Annotated[
        list[ProblemError], Field(description="Only with invalid-input, outside-domain and dataset-rejected.")
    ] = []
    domain: Annotated[DomainAnswer | None, Field(description="Only with outside-domain.")] = None
    report: Annotated[ReportAnswer | None, Field(description="Only with dataset-rejected.")] = None
    used_by: Annotated[DatasetUsers | None, Field(description="Only with dataset-in-use.")] = None
    error: Annotated[str, Field(description="The same text as `detail`.")]


class MobilityAnswer(BaseModel):
    """Outcome, speed and slip over slope x torque. Each table has a row for each torque and a column for each slope."""

    model: ModelIdentity
    mass_kg: float
    horizon_s: float
    confidence: Annotated[
        float | None, Field(description="Of the steepest slopes; null when the version has no band to judge it by.")
    ]
    steepest_by: Annotated[
        Literal["band", "central_estimate"],
        Field(description="Whether the steepest slopes follow the band's lower edge or the central estimate alone."),
    ]
    slope_deg: list[float]
    torque_nm: list[float]
    outcome: list[list[Outcome]]
    mean_speed_m_s: Annotated[list[list[float]], Field(description="Along the slope; negative downhill.")]
    slip_ratio: Annotated[list[list[float | None]], Field(description="null where wheels stand still.")]
    inside_domain: list[list[bool]]
    steepest_climb_slope_deg: Annotated[
        list[float | None],
        Field(
            description="For each torque the slope up to which every slope of the map is climbed, to 0.01 deg; never "
            "above the steepest slope of the map, null when not even its lowest is climbed."
        ),
    ]


class VersionIdentity(BaseModel):
    """One version of a model."""

    name: str
    version: int


class SuggestionReason(BaseModel):
    """Why a scenario is worth a simulation. Distances are those of the domain verdict."""

    expected_error_m: Annotated[
        float | None,
        Field(description="Error to expect of the final position; null when no run has a held-out error."),
    ]
    distance: Annotated[float, Field(description="Scaled distance to the nearest training run.")]
    nearest_run: str


class SuggestedRunAnswer(BaseModel):
    """One row of a `runs.csv`, and why it is there."""

    file: str
    set: str
    slope_deg: float
    mass_kg: float
    torque_nm: Annotated[float, Field(description="Motor stall torque per wheel.")]
    horizon_s: float
    step_s: Annotated[float, Field(description="Seconds between two rows of the file.")]
    reason: SuggestionReason


class SuggestedRunsAnswer(BaseModel):
    """What to simulate next, the most useful scenario first."""

    model: VersionIdentity
    runs: list[SuggestedRunAnswer]
