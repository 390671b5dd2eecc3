"""What a client sends to ask for a prediction: one definition of the fields, read from a query or from a JSON body."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from service.allowed import allowed_values
from service.api.encoders import Format
from service.errors import InvalidValueError
from service.learning.band import HIGHEST_LEVEL, LOWEST_LEVEL, USUAL_LEVEL
from service.settings import LIMITS
from service.twin import Frame
from service.twin.scenario import sample_count

_REFERENCE = r"^[a-z0-9][a-z0-9-]{0,62}(@([a-z][a-z0-9-]{0,62}|[1-9][0-9]{0,8}))?$"


class Include(StrEnum):
    """Parts of the answer that come on request only."""

    PRIOR = "prior"
    BAND = "band"


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
            description="How far to predict, in seconds from rest.",
            examples=[10],
        ),
    ] = 10.0
    dt_s: Annotated[
        float,
        Field(
            ge=LIMITS.dt_s[0],
            le=LIMITS.dt_s[1],
            description="Time between two points in seconds. The horizon itself is always the last point. "
            "A trajectory has at most 100,000 points unless the operator set another limit.",
            examples=[0.05],
        ),
    ] = 0.05
    model: Annotated[
        str,
        Field(
            pattern=_REFERENCE,
            description="Which model answers: `name`, `name@3` (a version) or `name@champion` (an alias). "
            "Without it, the service's default model.",
            examples=["viper-lunar@champion"],
            default_factory=str,  # empty: left out; nobody can send that
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
            "that was published without one.",
            examples=[["prior", "band"]],
        ),
    ] = []
    band_level: Annotated[
        float,
        Field(
            ge=LOWEST_LEVEL,
            le=HIGHEST_LEVEL,
            description="How often the truth shall lie in the band, time by time; matters with `include=band` only.",
            examples=[0.9],
        ),
    ] = USUAL_LEVEL
    strict: Annotated[
        bool,
        Field(description="Refuse a scenario outside the model's domain with a 422 instead of answering a verdict."),
    ] = False

    @property
    def wanted_band_level(self) -> float | None:
        """The level of the band that was asked for; None without `include=band`."""
        return self.band_level if Include.BAND in self.include else None


class PredictionBody(PredictionInputs):
    """A prediction asked for as a JSON object. Numbers must be numbers: `"28"` and `true` are refused."""

    model_config = ConfigDict(
        strict=True, json_schema_extra={"examples": [{"slope_deg": 28, "mass_kg": 430, "torque_nm": 60}]}
    )


class FormatQuery(BaseModel):
    """How the answer is written; it belongs to the address, not to the scenario."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Annotated[
        Format | SkipJsonSchema[None],
        Field(description="Form of the answer; it wins over the `Accept` header. Without both, JSON."),
    ] = None


def _split_commas(value: object) -> object:
    """`include=a,b` and `include=a&include=b` mean the same in a query."""
    if isinstance(value, list):
        return [part for each in value for part in str(each).split(",")]
    return value


class PredictionQuery(FormatQuery, PredictionInputs):
    """A prediction asked for in the query of a GET; text becomes numbers."""

    include: Annotated[
        list[Include],
        BeforeValidator(_split_commas),
        Field(
            max_length=len(Include),
            description=str(PredictionInputs.model_fields["include"].description) + " Several with commas.",
        ),
    ] = []


def _allowed() -> dict[str, str]:
    schema: dict[str, Any] = PredictionQuery.model_json_schema()
    definitions = schema.get("$defs", {})

    def resolved(node: dict[str, Any]) -> dict[str, Any]:
        node = {**definitions.get(node.get("$ref", "").rpartition("/")[2], {}), **node}
        if "items" in node:
            node["items"] = resolved(node["items"])
        if "anyOf" in node:
            node["anyOf"] = [resolved(part) for part in node["anyOf"]]
        return node

    return {name: allowed_values(resolved(field)) for name, field in schema["properties"].items()}


ALLOWED = _allowed()
"""What each field of a prediction accepts, in words."""


def require_few_points(asked: PredictionInputs, max_points: int) -> None:
    """Raises InvalidValueError, with the steps that this horizon allows, for more than `max_points` points."""
    if sample_count(asked.horizon_s, asked.dt_s) > max_points:
        finest = smallest_step_s(asked.horizon_s, max_points)
        allowed = (
            f"{finest:g} to {LIMITS.dt_s[1]:g} for a horizon_s of {asked.horizon_s:g} (at most {max_points} points)"
        )
        raise InvalidValueError("dt_s", asked.dt_s, allowed)


def smallest_step_s(horizon_s: float, max_points: int) -> float:
    """The smallest step that keeps to `max_points`, rounded up to three significant digits so that it can be typed."""
    exact = max(horizon_s / (max_points - 1), LIMITS.dt_s[0])
    unit = 10.0 ** (math.floor(math.log10(exact)) - 2)
    return float(f"{math.ceil(exact / unit * (1 - 1e-12)) * unit:.3g}")
