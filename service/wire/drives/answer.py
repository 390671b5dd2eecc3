"""The models of a drive's answer. They describe and are tested; `service.wire.forms` writes it."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

from service.twin import Frame
from service.twin.drives import DriveOutcome, EventName
from service.wire.prediction_answer import BandAnswer, DomainReason, Metres, ModelIdentity, WheelSpeed

_Speeds = Annotated[list[float], Field(description="Metres per second along the track, positive uphill.")]
_Slopes = Annotated[list[float], Field(description="Degrees, under the rover's middle.")]
_Torques = Annotated[
    list[float], Field(description="Stall torque of each wheel's motor, as told from each time on; 0 under the brake.")
]
_Slips = Annotated[
    list[float],
    Field(
        description="(R w - v) / max(|R w|, |v|), w the mean of both axles: 0 rolls, 1 spins on the spot, -1 slides "
        "with locked wheels; 0 where everything stands."
    ),
]
_Times = Annotated[list[float], Field(description="Seconds from the start, rising; the last one is the end.")]


class DriveEcho(BaseModel):
    """The drive as it was understood, with defaults filled in."""

    mass_kg: float
    knots: Annotated[int, Field(description="Of the track, as slopes over distance.")]
    controls: Annotated[int, Field(description="How many times torque or brake are told.")]
    start_speed_m_s: Annotated[float | None, Field(description="null: parked and let go.")]
    horizon_s: float
    until_distance_m: float | None


class DriveTrajectory(BaseModel):
    """The rear wheel's centre along the track and normal to it, with `frame=world` horizontal and up."""

    time_s: _Times
    x_m: Metres
    y_m: Annotated[list[float] | None, Field(description="Only in the slope frame.")] = None
    z_m: Annotated[list[float] | None, Field(description="Only in the world frame.")] = None
    speed_m_s: _Speeds
    slope_deg: _Slopes
    torque_nm: _Torques
    brake: Annotated[list[bool], Field(description="Whether the wheels are locked from each time on.")]
    slip_ratio: _Slips
    rear_wheel_speed_rad_s: WheelSpeed = None
    front_wheel_speed_rad_s: WheelSpeed = None


class DriveEvent(BaseModel):
    """What happens on the way. `sticks`: motors on, no brake, slower than 0.015 m/s for a second or more. `slides`:
    back faster than that for half a second or more. `goes_on`: after one of these forwards again, faster than that, for
    half a second or more. `passes`: its middle passes the last knot of the track. `arrives`: at `until_distance_m`.
    """

    event: EventName
    time_s: Annotated[float, Field(description="When it began.")]
    x_m: Annotated[float, Field(description="Distance of the rear wheel along the track then, in both frames.")]


class DriveProbabilities(BaseModel):
    """How probable each outcome is; they add up to 1."""

    passes: float
    sticks: float
    slides: float


class DriveSummaryAnswer(BaseModel):
    """The drive in a few numbers, the same however it is sampled; positions in the slope frame."""

    outcome: Annotated[
        DriveOutcome,
        Field(description="The most probable one, by the speed over the last quarter of the time with motors on."),
    ]
    probabilities: Annotated[
        DriveProbabilities | None, Field(description="null for a version that does not know its errors.")
    ]
    arrival_time_s: Annotated[float | None, Field(description="At `until_distance_m`; null if it does not arrive.")]
    arrival_earliest_s: Annotated[float | None, Field(description="With a probability of `band_level` not before.")]
    arrival_latest_s: Annotated[float | None, Field(description="And not after; null: not within the horizon.")]
    motor_energy_j: Annotated[float, Field(description="Mechanical energy that the motors gave to all wheels.")]
    steepest_slope_deg: Annotated[float, Field(description="Slope of largest size that its middle met.")]
    steepest_at_m: Annotated[float, Field(description="Where along the track that is.")]
    final_x_m: float
    final_y_m: float
    distance_m: Annotated[float, Field(ge=0, description="Length of the path.")]
    mean_speed_m_s: Annotated[float, Field(description="Along the track; negative downhill.")]
    duration_s: float


class DriveStretch(BaseModel):
    """A part of the way: from one place of the rear wheel and one time to the next; at most some 0.05 s off."""

    from_m: float
    to_m: float
    from_s: float
    to_s: float
    inside: bool
    reasons: Annotated[list[DomainReason], Field(description="What is outside, each with its furthest value.")]


class DriveDomainAnswer(BaseModel):
    """Where on its way the drive lies among the runs that the version was trained on."""

    inside: Annotated[bool, Field(description="Everywhere.")]
    stretches: list[DriveStretch]
    left_out: Annotated[int, Field(ge=0, description="Stretches beyond the first hundred.")]


class DriveAnswer(BaseModel):
    """One drive."""

    model: ModelIdentity
    drive: DriveEcho
    frame: Frame
    trajectory: DriveTrajectory
    band: Annotated[BandAnswer | None, Field(description="Only on `include=band`.")] = None
    events: list[DriveEvent]
    events_left_out: Annotated[int, Field(ge=0, description="Events beyond the first hundred.")]
    summary: DriveSummaryAnswer
    domain: DriveDomainAnswer
