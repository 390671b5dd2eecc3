"""The values that the service answers, as frozen dataclasses. Arrays are read-only, and numbers in them float64.

In the frame `slope`, x runs along the slope, positive uphill, and y is normal to it. In the frame `world`, x is
horizontal and z is up. So a trajectory has `y_m` in the slope frame and `z_m` in the world frame; the other is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Frame: TypeAlias = Literal["slope", "world"]
Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Words: TypeAlias = NDArray[np.str_]


@dataclass(frozen=True, slots=True)
class Scenario:
    """The scenario that the service predicted, with its defaults. The torque is the motor stall torque per wheel."""

    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float


@dataclass(frozen=True, slots=True)
class ModelIdentity:
    """The version that answered, and the alias that the caller asked for (None when it asked for a number)."""

    name: str
    version: int
    alias: str | None

    def __str__(self) -> str:
        return f"{self.name}@{self.version}"


@dataclass(frozen=True, slots=True)
class DomainReason:
    """One input that lies outside the validated region, with the bounds of the region in the unit of the input.

    The field `joint` stands for all inputs together. Its value is the scaled distance to the nearest training run.
    """

    field: str
    value: float
    lowest: float | None
    highest: float | None
    detail: str


@dataclass(frozen=True, slots=True)
class NearestRun:
    """A training run near the scenario, and its scaled distance to the scenario.

    `left_out_final_error_m` is the error of its final position when the model was trained without this run, or None
    when that was not measured.
    """

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    left_out_final_error_m: float | None
    distance: float


@dataclass(frozen=True, slots=True)
class Domain:
    """Whether the scenario lies inside the region where the model was validated; if not, `reasons` says why.

    `distance` is the distance to the nearest training run, scaled by the spread of the runs. For a version or a service
    that does not list its runs, `distance` is None and `nearest_runs` is empty.
    """

    inside: bool
    reasons: tuple[DomainReason, ...]
    distance: float | None = None
    nearest_runs: tuple[NearestRun, ...] = ()


@dataclass(frozen=True, slots=True)
class Summary:
    """A summary of the trajectory, the same however it is sampled. `outcome` is climbs, stalls or slides.

    The final coordinates are always in the slope frame. `slip_ratio` is None when the wheels stand still, or when the
    model does not know how they turn.
    """

    outcome: str
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    slip_ratio: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The closed-form trajectory, without the learned correction, at the times of the prediction; arrays (N,)."""

    name: str
    x_m: Array
    y_m: Array | None
    z_m: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Lower and upper bounds of x and y in the slope frame, at the times of the prediction; arrays (N,), in metres.

    `level` is the pointwise coverage: for runs like the training runs, the true position lies inside at this share of
    all times.
    """

    level: float
    x_lower_m: Array
    x_upper_m: Array
    y_lower_m: Array
    y_upper_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Where the rover goes: positions in metres at the times `time_s` in seconds; arrays (N,).

    The last time is the horizon. `prior` and `band` are None unless the call had `include=["prior", "band"]`. With
    `speed` and `wheel_speed` in it, `speed_m_s` is the speed along the slope in both frames, positive uphill, and the
    wheel speeds of both axles are in rad/s; arrays (N,), else None.
    """

    model: ModelIdentity
    scenario: Scenario
    frame: Frame
    time_s: Array
    x_m: Array
    y_m: Array | None
    z_m: Array | None
    prior: Prior | None
    domain: Domain
    summary: Summary
    band: Band | None = None
    speed_m_s: Array | None = None
    rear_wheel_speed_rad_s: Array | None = None
    front_wheel_speed_rad_s: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MobilityMap:
    """Outcome, speed and slip of one mass. A table has a row for each torque (T) and a column for each slope (S).

    `outcome` is climbs, stalls or slides. `mean_speed_m_s` is the speed along the slope, negative downhill.
    `slip_ratio` is NaN when the wheels stand still, or when the model does not know how they turn.

    `steepest_climb_slope_deg` has one slope for each torque: the rover climbs every slope of the map up to this one. It
    is NaN when the rover does not even climb the lowest slope, or when no cell of the torque is inside the domain.
    `steepest_inside_domain` says for each torque whether that slope is itself inside; None where there is none.
    `steepest_by` says how this was judged: by the `band`, with `confidence`, or by the `central_estimate` of a version
    without a band (`confidence` is None).
    """

    model: ModelIdentity
    mass_kg: float
    horizon_s: float
    confidence: float | None
    steepest_by: str
    torque_nm: Array  # (T,)
    slope_deg: Array  # (S,)
    outcome: Words  # (T, S)
    mean_speed_m_s: Array  # (T, S)
    slip_ratio: Array  # (T, S)
    inside_domain: Flags  # (T, S)
    steepest_climb_slope_deg: Array  # (T,)
    steepest_inside_domain: tuple[bool | None, ...]  # (T,)


@dataclass(frozen=True, slots=True)
class SuggestionReason:
    """Why a scenario is worth a simulation: the expected error of its final position, and the nearest training run.

    `expected_error_m` is None when no run of the version has a left-out error. `distance` is the distance to the
    nearest run, scaled by the spread of the runs.
    """

    expected_error_m: float | None
    distance: float
    nearest_run: str


@dataclass(frozen=True, slots=True)
class SuggestedRun:
    """A scenario to simulate, as a row of `runs.csv` in a dataset. Its file has one row every `step_s` seconds."""

    file: str
    set: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    step_s: float
    reason: SuggestionReason


@dataclass(frozen=True, slots=True)
class SuggestedRuns:
    """Scenarios whose simulation makes the next version better than `model`; the most useful one is first."""

    model: ModelIdentity
    runs: tuple[SuggestedRun, ...]


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """A model: its versions that can be used, archived and deleted ones, rising; and the version of each alias."""

    name: str
    versions: tuple[int, ...]
    aliases: Mapping[str, int]
    description: str | None = None
    archived: tuple[int, ...] = ()
    deleted: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Readiness:
    """The service can predict. `model` is the version that answers by default, `failures` what it could not load.

    A service tells failures to clients with a token only.
    """

    model: ModelIdentity
    failures: tuple[object, ...]
