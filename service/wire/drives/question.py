"""What a client sends to ask for a drive: one definition of the fields, for a single drive and for many."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, FailFast, Field
from pydantic.config import JsonDict
from pydantic.json_schema import SkipJsonSchema

from service.allowed import Words
from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import Frame
from service.twin.drives import HORIZON_S, DriveQuestion, Ground, Wanted, controls_of
from service.twin.scenario import sample_count
from service.wire.points import require_few_times, require_wide_step
from service.wire.prediction import STEP_S, PredictionInputs

MOST_KNOTS = 10_000
FURTHEST_M = 100_000.0
FASTEST_START_M_S = 5.0

_FIELDS = PredictionInputs.model_fields
_KNOTS = f"1 to {MOST_KNOTS:,}"

_Place = Annotated[float, Field(ge=-FURTHEST_M, le=FURTHEST_M)]
_PLACES = f"{_KNOTS} rising numbers from {-FURTHEST_M:g} to {FURTHEST_M:g}"
_SLOPES = f"as many numbers from {-LIMITS.slope_deg:g} to {LIMITS.slope_deg:g}"
_TIMES = f"{_KNOTS} rising numbers from 0, the first, to {LIMITS.horizon_s[1]:g}"
_TORQUES = f"as many numbers from {LIMITS.torque_nm[0]:g} to {LIMITS.torque_nm[1]:g}"


def _listed(words: str, description: str, examples: list[Any], *, needed: bool = False, fewest: int = 1) -> Any:  # noqa: ANN401 - a FieldInfo
    more: dict[str, Any] = {} if needed else {"default_factory": list}  # empty: not given; nobody can send that
    schema: JsonDict = {"x-allowed": words, "minItems": fewest, "maxItems": MOST_KNOTS}
    return Field(min_length=1, description=description, examples=examples, json_schema_extra=schema, **more)


class TrackInputs(BaseModel):
    """The ground: `distance_m` with `slope_deg`, or `horizontal_m` with `elevation_m`.

    Distances are along the surface, both are 0 where the rear wheel starts. Between knots the slope changes linearly
    with the distance, beyond them it stays. The slope that acts is that under the rover's middle, half a wheelbase
    ahead of the rear wheel. From elevations, each segment has its slope at its middle.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    distance_m: Annotated[
        list[_Place],
        FailFast(),
        _listed(_PLACES, "Distances along the surface in metres, rising.", [[0, 5, 10]]),
    ]
    slope_deg: Annotated[
        list[Annotated[float, Field(ge=-LIMITS.slope_deg, le=LIMITS.slope_deg)]],
        FailFast(),
        _listed(_SLOPES, "Slope at each distance in degrees; positive means uphill.", [[10, 22, 15]]),
    ]
    horizontal_m: Annotated[
        list[_Place],
        FailFast(),
        _listed(_PLACES.replace("1 to", "2 to"), "Horizontal places in metres, rising.", [[0, 5, 10]], fewest=2),
    ]
    elevation_m: Annotated[
        list[_Place],
        FailFast(),
        _listed(
            f"as many numbers from {-FURTHEST_M:g} to {FURTHEST_M:g}, with slopes from {-LIMITS.slope_deg:g} to "
            f"{LIMITS.slope_deg:g} deg",
            "Elevation of the ground at each place in metres.",
            [[0, 1.2, 2.1]],
            fewest=2,
        ),
    ]

    def ground(self) -> Ground:
        """The ground. Raises InvalidValueError for what is no track."""
        given = [name for name in TrackInputs.model_fields if getattr(self, name)]
        if given not in (["distance_m", "slope_deg"], ["horizontal_m", "elevation_m"]):
            allowed = "distance_m with slope_deg, or horizontal_m with elevation_m"
            raise InvalidValueError("track", ", ".join(given) or "empty", allowed)
        for name in given:
            _require_few(f"track.{name}", getattr(self, name))
        if self.distance_m:
            return Ground.of_slopes(self.distance_m, self.slope_deg)
        return Ground.of_elevations(self.horizontal_m, self.elevation_m, LIMITS.slope_deg)


class ControlsInputs(BaseModel):
    """What the motors are told, from each time on until the next."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    time_s: Annotated[
        list[Annotated[float, Field(ge=0, le=LIMITS.horizon_s[1])]],
        FailFast(),
        _listed(_TIMES, "Times in seconds from the start, rising; the first is 0.", [[0, 8, 10]], needed=True),
    ]
    torque_nm: Annotated[
        list[Annotated[float, Field(ge=LIMITS.torque_nm[0], le=LIMITS.torque_nm[1])]],
        FailFast(),
        _listed(
            _TORQUES,
            "Stall torque of the motor of each wheel in N m from each time on. 0: motors off, the wheels turn freely.",
            [[60, 0, 80]],
            needed=True,
        ),
    ]
    brake: Annotated[
        list[bool],
        FailFast(),
        _listed(
            "as many of true or false",
            "Whether the wheels are locked from each time on, with motors off whatever the torque. Without: never.",
            [[False, True, False]],
        ),
    ]


def _alone(value: object) -> object:
    """One torque for the whole drive is controls with one time; one out of range is refused as the number it is."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        if not LIMITS.torque_nm[0] <= value <= LIMITS.torque_nm[1]:
            raise ValueError("out of range")
        return {"time_s": [0.0], "torque_nm": [value]}
    return value


class DriveInclude(StrEnum):
    """Parts of the answer that a client has to ask for."""

    BAND = "band"
    WHEEL_SPEED = "wheel_speed"


class OneDrive(BaseModel):
    """A rover, its track, its controls, and until when."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mass_kg: Annotated[
        float, *_FIELDS["mass_kg"].metadata, Field(description=_FIELDS["mass_kg"].description, examples=[430])
    ]
    track: Annotated[
        TrackInputs,
        BeforeValidator(lambda value: value),  # an object may become a model though numbers must be numbers
        Field(
            description="The ground.",
            json_schema_extra={"x-allowed": "distance_m with slope_deg, or horizontal_m with elevation_m"},
        ),
    ]
    controls: Annotated[
        ControlsInputs,
        BeforeValidator(
            _alone,
            json_schema_input_type=Annotated[float, Field(ge=LIMITS.torque_nm[0], le=LIMITS.torque_nm[1])]
            | ControlsInputs,
        ),
        Field(
            description="Stall torque of the motor of each wheel in N m for the drive, or what changes over time.",
            examples=[60],
            json_schema_extra={
                "x-allowed": f"a number from {LIMITS.torque_nm[0]:g} to {LIMITS.torque_nm[1]:g}, or time_s with "
                "torque_nm and brake"
            },
        ),
    ]
    start_speed_m_s: Annotated[
        Annotated[float, Field(ge=-FASTEST_START_M_S, le=FASTEST_START_M_S)] | SkipJsonSchema[None],
        Field(
            description="Speed along the track at the start in m/s, positive uphill. Without: parked and let go.",
            examples=[0.3],
        ),
    ] = None
    horizon_s: Annotated[
        Annotated[float, Field(ge=LIMITS.horizon_s[0], le=LIMITS.horizon_s[1])] | SkipJsonSchema[None],
        Field(
            description=f"Longest duration in seconds. Without, {HORIZON_S:g}; {LIMITS.horizon_s[1]:g} with "
            "`until_distance_m`; with `times_s` the last of them.",
            examples=[20],
        ),
    ] = None
    until_distance_m: Annotated[
        Annotated[float, Field(gt=0, le=FURTHEST_M)] | SkipJsonSchema[None],
        Field(
            description="Where the drive ends: distance of the rear wheel along the track in metres.",
            examples=[8],
        ),
    ] = None

    def question(self, times_s: Array | None) -> DriveQuestion:
        """What is asked; `times_s` are those that were sent. Raises InvalidValueError for what does not fit."""
        ground = self.track.ground()
        for name in ControlsInputs.model_fields:
            _require_few(f"controls.{name}", getattr(self.controls, name))
        controls = controls_of(self.controls.time_s, self.controls.torque_nm, self.controls.brake or None)
        return DriveQuestion(
            self.mass_kg, ground, controls, self.start_speed_m_s, self.longest_s(times_s), self.until_distance_m
        )

    def longest_s(self, times_s: Array | None) -> float:
        """How long the drive lasts at most, s. Raises InvalidValueError for a horizon that is not the last time."""
        if times_s is not None:
            if self.horizon_s is not None and self.horizon_s != times_s[-1]:
                raise InvalidValueError(
                    "horizon_s", self.horizon_s, f"the last of times_s, which is {times_s[-1]:.12g}"
                )
            return float(times_s[-1])
        if self.horizon_s is not None:
            return self.horizon_s
        return HORIZON_S if self.until_distance_m is None else LIMITS.horizon_s[1]


class DriveSampling(BaseModel):
    """How finely to sample drives, and who answers how."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    dt_s: Annotated[
        float,
        *_FIELDS["dt_s"].metadata,
        Field(
            description=f"Time between two points in seconds; {STEP_S:g} without it. The end is always the last point. "
            "A trajectory has at most 100,000 points unless the operator set another limit.",
            examples=[0.05],
            default_factory=lambda: STEP_S,
        ),
    ]
    times_s: Annotated[
        list[Annotated[float, Field(ge=0, le=LIMITS.horizon_s[1])]],
        FailFast(),
        Field(
            min_length=1,
            description="The times to answer at, in seconds from the start, rising; instead of `dt_s`. The last one is "
            "the horizon. Those after an arrival are left out, and the arrival is the last point. At most 100,000 "
            "unless the operator set another limit.",
            examples=[[0, 0.5, 2, 10]],
            default_factory=list,  # empty: not given; nobody can send that
            json_schema_extra=_FIELDS["times_s"].json_schema_extra,
        ),
    ]
    model: Annotated[
        str,
        *_FIELDS["model"].metadata,
        Field(
            description=f"{_FIELDS['model'].description} Only versions with the drive model can drive.",
            examples=["viper-lunar@champion"],
            default_factory=str,  # empty: not given; nobody can send that
            json_schema_extra=_FIELDS["model"].json_schema_extra,
        ),
    ]
    frame: Annotated[
        Frame,
        Field(
            strict=False,
            description="Frame of the positions. `slope`: x along the track, y normal to it. `world`: x horizontal, "
            "z up, as the track goes. x starts at zero; y counts from the undeformed surface.",
        ),
    ] = Frame.SLOPE
    include: Annotated[
        list[Annotated[DriveInclude, Field(strict=False)]],
        Field(
            max_length=len(DriveInclude),
            description="Parts to add: `band` is an interval for x and one for y at each time, slope frame only; it is "
            "refused by a version that was published without one. `wheel_speed` says how fast the wheels turn.",
            examples=[["band", "wheel_speed"]],
        ),
    ] = []
    band_level: Annotated[
        float,
        *_FIELDS["band_level"].metadata,
        Field(
            description="Pointwise coverage of the band, and of the interval in which the rover arrives.",
            examples=[0.9],
        ),
    ] = _FIELDS["band_level"].default
    strict: Annotated[
        bool,
        Field(
            description="Answer 422 to a drive that leaves the model's domain. Otherwise `domain` says where it does."
        ),
    ] = False

    def own_times(self) -> Array | None:
        """The times that were sent, (time,), s; None where `dt_s` makes them. Raises InvalidValueError."""
        if not self.times_s:
            return None
        times = np.array(self.times_s, dtype=np.float64)
        allowed = WORDS["times_s"]
        steps = np.diff(times) > 0
        if not steps.all():
            at = int(steps.argmin())
            raise InvalidValueError("times_s", f"{times[at]:.12g}, {times[at + 1]:.12g}", allowed)
        if times[-1] < LIMITS.horizon_s[0]:
            raise InvalidValueError("times_s", float(times[-1]), allowed)
        if "dt_s" in self.model_fields_set:
            raise InvalidValueError("dt_s", self.dt_s, "nothing beside times_s: one of them says when to answer")
        return times

    def wanted(self, times_s: Array | None) -> Wanted:
        """The same for the twin."""
        return Wanted(
            dt_s=self.dt_s,
            times_s=times_s,
            frame=self.frame,
            band=DriveInclude.BAND in self.include,
            band_level=self.band_level,
            wheel_speed=DriveInclude.WHEEL_SPEED in self.include,
        )


_EXAMPLE: dict[str, Any] = {
    "mass_kg": 430,
    "track": {"distance_m": [0, 3, 6, 9], "slope_deg": [10, 22, 18, 12]},
    "controls": {"time_s": [0, 8, 10], "torque_nm": [60, 0, 80], "brake": [False, True, False]},
    "horizon_s": 20,
}


class DriveBody(DriveSampling, OneDrive):
    """A drive asked for as a JSON object. Numbers must be numbers: `"28"` and `true` are refused."""

    model_config = ConfigDict(
        strict=True,
        json_schema_extra={
            "examples": [
                _EXAMPLE,
                {
                    "mass_kg": 430,
                    "track": {"horizontal_m": [0, 4, 8], "elevation_m": [0, 1.1, 2.6]},
                    "controls": 60,
                    "until_distance_m": 7,
                },
            ]
        },
    )

    def points(self) -> int:
        """How many points the trajectory has at most."""
        return len(self.times_s) if self.times_s else sample_count(self.longest_s(None), self.dt_s)

    def asked(self, max_points: int) -> tuple[DriveQuestion, Wanted]:
        """What is asked of the twin. Raises InvalidValueError for what does not fit together, or too many points."""
        times = self.own_times()
        if times is not None:
            require_few_times(len(times), 1, max_points)
        else:
            require_wide_step(self.longest_s(None), self.dt_s, 1, max_points)
        return self.question(times), self.wanted(times)


def _require_few(field: str, values: Sequence[object]) -> None:
    if len(values) > MOST_KNOTS:
        raise InvalidValueError(field, f"{len(values)} values", f"{_KNOTS} values")


WORDS = Words.of(DriveBody)
"""What each field of a drive accepts, in words."""
