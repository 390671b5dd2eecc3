"""What a client sends to ask for a prediction: one definition of the fields, read from a query or from a JSON body."""

from __future__ import annotations

import time
from enum import StrEnum
from typing import Annotated, NamedTuple

import numpy as np
import orjson
from pydantic import BaseModel, BeforeValidator, ConfigDict, FailFast, Field
from pydantic.json_schema import SkipJsonSchema

from service.allowed import Words
from service.errors import InvalidValueError
from service.learning.band import HIGHEST_LEVEL, LOWEST_LEVEL, USUAL_LEVEL
from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import Count, Frame, Loaded, Scenario, sample_times, uncounted
from service.twin.scenario import sample_count
from service.wire.commas import split_commas
from service.wire.forms import Format, Subject, TableFormat
from service.wire.points import require_few_times, require_wide_step
from service.wire.stage_inputs import StageInputs

REFERENCE = r"^[a-z0-9][a-z0-9-]{0,62}(@([a-z][a-z0-9-]{0,62}|[1-9][0-9]{0,8}))?$"

# Made by a function, so that the OpenAPI document has no default for them: they hold only where no `times_s` are sent,
# and generated clients send every default that they read, `dt_s` beside `times_s` too, which is refused.
HORIZON_S, STEP_S = 10.0, 0.05

_Time = Annotated[float, Field(ge=0, le=LIMITS.horizon_s[1])]
_TIMES = f"rising times from 0 to {LIMITS.horizon_s[1]:g}, the last one at least {LIMITS.horizon_s[0]:g}"


class Include(StrEnum):
    """Parts of the answer that a client has to ask for."""

    PRIOR = "prior"
    BAND = "band"
    SPEED = "speed"
    WHEEL_SPEED = "wheel_speed"


# Python looks for a member of an enumeration in three places before it finds it, and each question asks for these.
_PRIOR, _BAND, _SPEED, _WHEEL_SPEED = Include


class Parts(NamedTuple):
    """What was asked for besides positions. `band_level` is None without a band."""

    prior: bool
    band_level: float | None
    speed: bool
    wheel_speed: bool


_NO_PARTS = Parts(False, None, False, False)


class PredictionInputs(BaseModel):
    """The scenario, how finely to sample it, and who answers how."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    slope_deg: Annotated[
        float,
        Field(
            ge=-LIMITS.slope_deg,
            le=LIMITS.slope_deg,
            description="Slope of the terrain in degrees; positive means that the rover faces uphill.",
            examples=[28],
        ),
    ]
    mass_kg: Annotated[
        float,
        Field(ge=LIMITS.mass_kg[0], le=LIMITS.mass_kg[1], description="Mass of the rover in kg.", examples=[430]),
    ]
    torque_nm: Annotated[
        float,
        Field(
            ge=LIMITS.torque_nm[0],
            le=LIMITS.torque_nm[1],
            description="Stall torque of the motor of each wheel in N m: what it gives when the wheel stands still.",
            examples=[60],
        ),
    ]
    horizon_s: Annotated[
        float,
        Field(
            ge=LIMITS.horizon_s[0],
            le=LIMITS.horizon_s[1],
            description=f"Length of the prediction in seconds, from rest; {HORIZON_S:g} without it. With `times_s` it "
            "is the last of them.",
            examples=[10],
            default_factory=lambda: HORIZON_S,
        ),
    ]
    dt_s: Annotated[
        float,
        Field(
            ge=LIMITS.dt_s[0],
            le=LIMITS.dt_s[1],
            description=f"Time between two points in seconds; {STEP_S:g} without it. The horizon itself is always the "
            "last point. A trajectory has at most 100,000 points unless the operator set another limit.",
            examples=[0.05],
            default_factory=lambda: STEP_S,
        ),
    ]
    times_s: Annotated[
        list[_Time],
        FailFast(),
        Field(
            min_length=1,
            description="The times to answer at, in seconds from rest, rising; instead of `dt_s`. The last one is the "
            "horizon. At most 100,000 unless the operator set another limit; in a query those that fit into a head of "
            "32 KiB, some 4,000, so that longer lists need a POST.",
            examples=[[0, 0.5, 2, 10]],
            default_factory=list,  # empty: not given; nobody can send that
            json_schema_extra={"x-allowed": _TIMES},
        ),
    ]
    model: Annotated[
        str,
        Field(
            pattern=REFERENCE,
            description="Which model answers: `name`, `name@3` (a version) or `name@champion` (an alias). "
            "Without it, the service's default model.",
            examples=["viper-lunar@champion"],
            default_factory=str,  # empty: not given; nobody can send that
            json_schema_extra={"x-allowed": "name, name@version or name@alias, with a-z, 0-9 and - in names"},
        ),
    ]
    frame: Annotated[
        Frame,
        Field(
            strict=False,
            description="Frame of the positions. `slope`: x along the slope, positive uphill, y normal to it. "
            "`world`: x horizontal, z up. x starts at zero; y counts from the undeformed surface.",
        ),
    ] = Frame.SLOPE
    include: Annotated[
        list[Annotated[Include, Field(strict=False)]],
        Field(
            max_length=len(Include),
            description="Parts to add: `prior` is the closed-form solution alone, without the learned correction. "
            "`band` is an interval for x and one for y at each time, slope frame only; it is refused by a version "
            "that was published without one. `speed` adds to the trajectory the speed along the slope, in both frames, "
            "`wheel_speed` how fast rear and front wheels turn; it is refused by a version that does not know that.",
            examples=[["prior", "band", "speed"]],
            default_factory=list,  # one that is given would be copied, deeply, for each question
            json_schema_extra={"default": []},
        ),
    ]
    band_level: Annotated[
        float,
        Field(
            ge=LOWEST_LEVEL,
            le=HIGHEST_LEVEL,
            description="Pointwise coverage of the band: the share of all times at which it holds the simulated "
            "position. Used with `include=band` only.",
            examples=[0.9],
        ),
    ] = USUAL_LEVEL
    strict: Annotated[
        bool,
        Field(
            description="Answer 422 to a scenario outside the model's domain. "
            "Otherwise `domain` says that it is outside."
        ),
    ] = False

    @property
    def parts(self) -> Parts:
        """What was asked for besides."""
        asked = self.include
        if not asked:
            return _NO_PARTS
        return Parts(
            _PRIOR in asked, self.band_level if _BAND in asked else None, _SPEED in asked, _WHEEL_SPEED in asked
        )

    def question(self) -> bytes:
        """What decides the answer of a given version, in one way only; the same for questions that mean the same."""
        scenario = self.slope_deg, self.mass_kg, self.torque_nm, self.horizon_s, self.dt_s, self.times_s
        return orjson.dumps((scenario, self.frame, *self.parts, self.strict))

    @property
    def points(self) -> int:
        """How many points the trajectory has. Never fewer than what `sampled` returns."""
        return len(self.times_s) if self.times_s else sample_count(self.horizon_s, self.dt_s)

    def sampled(self) -> tuple[Scenario, Array]:
        """The scenario, and the times to answer at: shape (time,), s, the last one the scenario's horizon.

        Raises InvalidValueError for times that do not rise, end too early or at another time than a horizon that was
        given, and for times beside a step.
        """
        times = self._own_times() if self.times_s else sample_times(self.horizon_s, self.dt_s)
        return Scenario(self.slope_deg, self.mass_kg, self.torque_nm, float(times[-1])), times

    def _own_times(self) -> Array:
        times = np.array(self.times_s, dtype=np.float64)
        steps = np.diff(times)
        if not (steps > 0).all():
            at = int((steps <= 0).argmax())
            raise InvalidValueError("times_s", f"{times[at]:.12g}, {times[at + 1]:.12g}", _TIMES)
        if times[-1] < LIMITS.horizon_s[0]:
            raise InvalidValueError("times_s", float(times[-1]), _TIMES)
        if "dt_s" in self.model_fields_set:
            raise InvalidValueError("dt_s", self.dt_s, "nothing beside times_s: one of them says when to answer")
        if "horizon_s" in self.model_fields_set and self.horizon_s != times[-1]:
            raise InvalidValueError("horizon_s", self.horizon_s, f"the last of times_s, which is {times[-1]:.12g}")
        return times


class PredictionBody(PredictionInputs):
    """A prediction asked for as a JSON object. Numbers must be numbers: `"28"` and `true` are refused."""

    model_config = ConfigDict(
        strict=True, json_schema_extra={"examples": [{"slope_deg": 28, "mass_kg": 430, "torque_nm": 60}]}
    )


FORMAT = Field(description="Form of the answer; it wins over the `Accept` header. Without both, JSON.")


class FormatQuery(StageInputs):
    """How a prediction is written; it belongs to the address, not to the scenario."""

    format: Annotated[Format | SkipJsonSchema[None], FORMAT] = None


class TableFormatQuery(BaseModel):
    """How an answer that is no trajectory is written."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Annotated[TableFormat | SkipJsonSchema[None], FORMAT] = None


class PredictionQuery(FormatQuery, PredictionInputs):
    """A prediction asked for in the query of a GET; text becomes numbers."""

    include: Annotated[
        list[Include],
        BeforeValidator(split_commas),
        Field(
            max_length=len(Include),
            description=str(PredictionInputs.model_fields["include"].description) + " Several with commas.",
            default_factory=list,
            json_schema_extra={"default": []},
        ),
    ]
    times_s: Annotated[
        list[_Time],
        FailFast(),
        BeforeValidator(split_commas),
        Field(
            min_length=1,
            description=str(PredictionInputs.model_fields["times_s"].description) + " With commas between them; a long "
            "list is for a POST.",
            examples=[[0, 0.5, 2, 10]],
            default_factory=list,  # empty: not given; nobody can send that
            json_schema_extra={"x-allowed": _TIMES},
        ),
    ]


ALLOWED = Words.of(PredictionQuery)
"""What each field of a prediction accepts, in words."""


def require_few_points(asked: PredictionInputs, max_points: int) -> None:
    """Raises InvalidValueError for more than `max_points` points."""
    if asked.times_s:
        require_few_times(len(asked.times_s), 1, max_points)
    else:
        require_wide_step(asked.horizon_s, asked.dt_s, 1, max_points)


def predict(asked: PredictionInputs, loaded: Loaded, count: Count = uncounted) -> Subject:
    """The prediction that was asked for.

    Raises InvalidValueError for times, a band or wheel speeds that cannot be had, NonFiniteError, and
    OutsideDomainError where a strict client asks for a scenario outside the domain.
    """
    twin = loaded.twin
    scenario, times = asked.sampled()
    parts = asked.parts
    began = time.perf_counter()
    found = twin.predict(
        scenario,
        times,
        asked.frame,
        parts.band_level,
        with_prior=parts.prior,
        with_speed=parts.speed,
        with_wheel_speed=parts.wheel_speed,
    )
    count(twin, time.perf_counter() - began, (found.summary.outcome,), int(not found.domain.inside))
    if asked.strict and not found.domain.inside:
        raise twin.outside(found.domain)
    return Subject(loaded, found)
