"""The wire model of a batch's JSON answer. It describes and is tested; `service.wire.batch_forms` writes it."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from service.twin import Frame, Outcome
from service.wire.faults import ProblemError
from service.wire.prediction_answer import ModelIdentity

Rows = Annotated[list[list[float]], Field(description="A list for each scenario, metres, one per time.")]

WheelRows = Annotated[list[list[float]] | None, Field(description="Only on `include=wheel_speed`.")]


class BatchScenarios(BaseModel):
    """The scenarios that are answered, as understood; a column each."""

    index: Annotated[list[int], Field(description="Place among the scenarios that were sent, from 0.")]
    slope_deg: list[float]
    mass_kg: list[float]
    torque_nm: list[float]
    horizon_s: list[float]
    points: Annotated[list[int], Field(description="How many times each one has.")]


class BatchTrajectories(BaseModel):
    """Positions in the frame: `y_m` in the slope frame, `z_m` in the world frame. Speeds are along the slope."""

    time_s: Annotated[
        list[float] | list[list[float]],
        Field(description="Seconds from rest: one list where all scenarios share it, else a list for each."),
    ]
    x_m: Rows
    y_m: Rows | None = None
    z_m: Rows | None = None
    speed_m_s: Annotated[list[list[float]] | None, Field(description="Only on `include=speed`.")] = None
    rear_wheel_speed_rad_s: WheelRows = None
    front_wheel_speed_rad_s: WheelRows = None


class BatchPrior(BaseModel):
    """The closed-form solution alone, at the same times."""

    name: str | None = None
    x_m: Rows
    y_m: Rows | None = None
    z_m: Rows | None = None


class BatchBand(BaseModel):
    """An interval for x and one for y at each time, slope frame."""

    level: float | None = None
    x_lower_m: Rows
    x_upper_m: Rows
    y_lower_m: Rows
    y_upper_m: Rows


class BatchDomain(BaseModel):
    """Which scenarios lie among the runs that the version was trained on; a column each."""

    inside: list[bool]
    outside_of: Annotated[
        list[list[str]], Field(description="The inputs that are outside; `joint` is their combination.")
    ]
    distance: Annotated[
        list[float] | None, Field(description="To the nearest training run. Only if the version lists its runs.")
    ] = None
    nearest_run: list[str] | None = None


class BatchSummary(BaseModel):
    """The trajectories in six numbers each, in the slope frame; a column each."""

    outcome: list[Outcome]
    final_x_m: list[float]
    final_y_m: list[float]
    distance_m: list[float]
    mean_speed_m_s: list[float]
    slip_ratio: list[float | None]


class BatchError(BaseModel):
    """Why a scenario has no answer: the problem that the single route would answer. It may have further members."""

    model_config = ConfigDict(extra="allow")

    index: Annotated[int, Field(description="Place among the scenarios that were sent, from 0.")]
    type: str
    title: str
    status: int
    detail: str
    errors: list[ProblemError] | None = None


class BatchAnswer(BaseModel):
    """Many predictions in columns. All of `scenarios`, `trajectory`, `prior`, `band`, `domain` and `summary` have an
    entry for each scenario that is answered, in one order; `errors` lists the others.
    """

    model: ModelIdentity
    frame: Frame
    scenarios: BatchScenarios
    trajectory: BatchTrajectories
    prior: Annotated[BatchPrior | None, Field(description="Only on `include=prior`.")] = None
    band: Annotated[BatchBand | None, Field(description="Only on `include=band`.")] = None
    domain: BatchDomain
    summary: BatchSummary
    errors: list[BatchError]
