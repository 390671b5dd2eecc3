"""What the service answers, as values: frozen dataclasses whose arrays are read-only, numbers float64.

Frames: in `slope`, x runs along the slope (positive uphill) and y normal to it; in `world`, x is horizontal and z up.
A trajectory therefore has `y_m` in the slope frame and `z_m` in the world frame; the other one is None.
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
    """The question as the service understood it, defaults filled in. Torque is motor stall torque per wheel."""

    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float


@dataclass(frozen=True, slots=True)
class ModelIdentity:
    """Which version answered, and the alias it was asked by (None when asked by number)."""

    name: str
    version: int
    alias: str | None

    def __str__(self) -> str:
        return f"{self.name}@{self.version}"


@dataclass(frozen=True, slots=True)
class DomainReason:
    """One input that lies outside the validated region, with the region's bounds in the input's own unit.

    The field `joint` stands for all of them together: its value is the scaled distance to the nearest training run.
    """

    field: str
    value: float
    lowest: float | None
    highest: float | None
    detail: str


@dataclass(frozen=True, slots=True)
class NearestRun:
    """A training run, its scaled distance to the scenario, and how far off its end was predicted without it (m).

    The error is None where it was not measured.
    """

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    left_out_final_error_m: float | None
    distance: float


@dataclass(frozen=True, slots=True)
class Domain:
    """Whether the scenario lies where the model was validated; `reasons` is empty when inside.

    `distance` is that to the nearest training run, scaled by the spread of the runs. It is None, and `nearest_runs`
    empty, for versions and services that do not tell.
    """

    inside: bool
    reasons: tuple[DomainReason, ...]
    distance: float | None = None
    nearest_runs: tuple[NearestRun, ...] = ()


@dataclass(frozen=True, slots=True)
class Summary:
    """The trajectory in a few numbers. `outcome` is climbs, stalls or slides.

    The last coordinates are in the slope frame, whatever the prediction's own frame.
    `slip_ratio` is None where the wheels stand still or the model does not know how they turn.
    """

    outcome: str
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    slip_ratio: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The closed-form trajectory without the learned correction, at the prediction's own times; arrays (N,)."""

    name: str
    x_m: Array
    y_m: Array | None
    z_m: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Bounds of x and y at the prediction's own times, slope frame; arrays (N,), m.

    For runs like those the model was trained on, a share of `level` of all times lies inside.
    """

    level: float
    x_lower_m: Array
    x_upper_m: Array
    y_lower_m: Array
    y_upper_m: Array


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Where the rover goes: positions in metres at `time_s` in seconds, arrays (N,), the horizon last.

    `prior` and `band` are there when asked for with `include=["prior", "band"]`.
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


@dataclass(frozen=True, slots=True, eq=False)
class MobilityMap:
    """Outcome, speed and slip over slope x torque for one mass. A table has a row for each torque (T) and a column
    for each slope (S).

    `outcome` is climbs, stalls or slides; `mean_speed_m_s` runs along the slope, negative downhill. `slip_ratio` is
    NaN where the wheels stand still or the model does not know how they turn. `steepest_climb_slope_deg` is, for each
    torque, the slope up to which every slope of the map is climbed: never above the map's steepest, NaN when not even
    its lowest is climbed. `steepest_by` says how that was judged: `band`, with `confidence`, or `central_estimate`,
    by a version without a band (`confidence` is then None).
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


@dataclass(frozen=True, slots=True)
class SuggestionReason:
    """Why a scenario is worth a simulation: the error to expect of its final position (m), and the nearest run.

    The error is None where no run of the version has a left-out error. `distance` is scaled by the spread of the runs.
    """

    expected_error_m: float | None
    distance: float
    nearest_run: str


@dataclass(frozen=True, slots=True)
class SuggestedRun:
    """A scenario to simulate, as a row of a dataset's `runs.csv`: its file holds a row every `step_s`."""

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
    """What to simulate to make the next version better than `model`, the most useful scenario first."""

    model: ModelIdentity
    runs: tuple[SuggestedRun, ...]


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """A model, its published versions in rising order, and the version behind each alias."""

    name: str
    versions: tuple[int, ...]
    aliases: Mapping[str, int]
    description: str | None = None


@dataclass(frozen=True, slots=True)
class Readiness:
    """The service can predict: `model` is the default it answers with, `failures` what it could not load."""

    model: ModelIdentity
    failures: tuple[object, ...]
