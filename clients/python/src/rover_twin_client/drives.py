"""The values of drives: tracks and controls that change, steps, and what the service answers. Arrays are read-only.

Distance is that of the rear wheel's centre along the track, in metres, zero where the rover starts. The slope that acts
is the one under the rover's middle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from rover_twin_client.answers import Array, Band, DomainReason, Flags, Frame, ModelIdentity
from rover_twin_client.errors import FieldFault

Track: TypeAlias = Mapping[str, Sequence[float] | Array]
"""`{"distance_m": [...], "slope_deg": [...]}` or `{"horizontal_m": [...], "elevation_m": [...]}`."""
Controls: TypeAlias = float | Mapping[str, Sequence[float] | Sequence[bool] | Array | Flags]
"""A stall torque per wheel (N m), or `{"time_s": [...], "torque_nm": [...], "brake": [...]}`, each until the next."""
Transport: TypeAlias = Literal["websocket", "http"]


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """What happens at a time and place: `sticks`, `slides`, `goes_on`, `passes` (the last knot) or `arrives`."""

    event: str
    time_s: float
    x_m: float


@dataclass(frozen=True, slots=True)
class DriveSummary:
    """A summary of the drive, the same however it is sampled. `outcome` is passes, sticks or slides.

    `probabilities` are those of the three outcomes, None for a version that does not know its errors. The arrival is at
    `until_distance_m`, and with the probability of the band's level not before `arrival_earliest_s` nor after
    `arrival_latest_s`. Each is None when it lies beyond the horizon, and when no distance was asked for.
    """

    outcome: str
    probabilities: Mapping[str, float] | None
    arrival_time_s: float | None
    arrival_earliest_s: float | None
    arrival_latest_s: float | None
    motor_energy_j: float
    steepest_slope_deg: float
    steepest_at_m: float
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class Stretch:
    """A piece of the drive that lies inside the domain, or outside for `reasons`."""

    from_m: float
    to_m: float
    from_s: float
    to_s: float
    inside: bool
    reasons: tuple[DomainReason, ...]


@dataclass(frozen=True, slots=True)
class DriveDomain:
    """Whether the whole drive lies inside the region where the model was validated, and which stretches do."""

    inside: bool
    stretches: tuple[Stretch, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Where the rover goes along its track; arrays (N,) at the times `time_s`.

    `slope_deg`, `torque_nm` and `brake` are what acts at each time. `y_m` is None in the frame `world`, `z_m` in the
    frame `slope`. `band` and the wheel speeds are None unless they were included.
    """

    model: ModelIdentity
    frame: Frame
    time_s: Array
    x_m: Array
    y_m: Array | None
    z_m: Array | None
    speed_m_s: Array
    slope_deg: Array
    torque_nm: Array
    brake: Flags
    slip_ratio: Array
    rear_wheel_speed_rad_s: Array | None
    front_wheel_speed_rad_s: Array | None
    band: Band | None
    events: tuple[DriveEvent, ...]
    summary: DriveSummary
    domain: DriveDomain


@dataclass(frozen=True, slots=True)
class FailedDrive:
    """One drive of a batch that was refused: its place among those sent, and what is wrong with it."""

    index: int
    detail: str
    faults: tuple[FieldFault, ...]


@dataclass(frozen=True, slots=True)
class Moment:
    """A rover after a step. `state` carries everything that its future depends on; it is None unless asked for.

    `x_half_width_m` is half the width of the 90 % interval of `x_m`, None where the version has no doubt. `inside` says
    whether the model was validated here, `reasons` why not.
    """

    id: str
    state: str | None
    time_s: float
    x_m: float
    y_m: float
    speed_m_s: float
    rear_wheel_speed_rad_s: float
    front_wheel_speed_rad_s: float
    slip_ratio: float
    x_half_width_m: float | None
    moving: bool
    inside: bool
    reasons: tuple[str, ...]
