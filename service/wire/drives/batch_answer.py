"""The wire model of many drives' JSON answer. It describes and is tested; `service.wire.batch_forms` writes it."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

from service.twin import Frame
from service.twin.drives import DriveOutcome
from service.wire.batch_answer import BatchBand, BatchError, Rows, WheelRows
from service.wire.drives.answer import DriveEvent, DriveStretch
from service.wire.prediction_answer import ModelIdentity

_Maybe = list[float | None]


class BatchDrives(BaseModel):
    """The drives that are answered, as understood; a column each."""

    index: Annotated[list[int], Field(description="Place among the drives that were sent, from 0.")]
    mass_kg: list[float]
    knots: list[int]
    controls: list[int]
    start_speed_m_s: _Maybe
    horizon_s: list[float]
    until_distance_m: _Maybe
    points: Annotated[list[int], Field(description="How many times each one has.")]


class BatchDriveTrajectories(BaseModel):
    """The columns of single drives: a list for each drive, one number per time."""

    time_s: Annotated[
        list[float] | list[list[float]],
        Field(description="Seconds from the start: one list where all drives share it, else a list for each."),
    ]
    x_m: Rows | None = None
    y_m: Rows | None = None
    z_m: Rows | None = None
    speed_m_s: list[list[float]] | None = None
    slope_deg: list[list[float]] | None = None
    torque_nm: list[list[float]] | None = None
    brake: list[list[bool]] | None = None
    slip_ratio: list[list[float]] | None = None
    rear_wheel_speed_rad_s: WheelRows = None
    front_wheel_speed_rad_s: WheelRows = None


class BatchDriveDomain(BaseModel):
    """Which drives stay among the runs that the version was trained on; `stretches` says where they do not."""

    inside: list[bool]


class BatchDriveSummary(BaseModel):
    """What single drives' summaries say; a column each."""

    outcome: list[DriveOutcome]
    probability_passes: _Maybe
    probability_sticks: _Maybe
    probability_slides: _Maybe
    arrival_time_s: _Maybe
    arrival_earliest_s: _Maybe
    arrival_latest_s: _Maybe
    motor_energy_j: list[float]
    steepest_slope_deg: list[float]
    steepest_at_m: list[float]
    final_x_m: list[float]
    final_y_m: list[float]
    distance_m: list[float]
    mean_speed_m_s: list[float]
    duration_s: list[float]


class DriveBatchAnswer(BaseModel):
    """Many drives in columns. All of `drives`, `trajectory`, `band`, `domain`, `summary`, `events`, `events_left_out`
    and `stretches` have an entry for each drive that is answered, in one order; `errors` lists the others.
    """

    model: ModelIdentity
    frame: Frame
    drives: BatchDrives
    trajectory: BatchDriveTrajectories
    band: Annotated[BatchBand | None, Field(description="Only on `include=band`.")] = None
    domain: BatchDriveDomain
    summary: BatchDriveSummary
    events: list[list[DriveEvent]]
    events_left_out: list[int]
    stretches: list[list[DriveStretch]]
    errors: list[BatchError]
