"""The models of a prediction's answer. They describe and are tested; `service.wire.forms` writes it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field

from service.twin import Frame, Outcome

Metres = Annotated[list[float], Field(description="Metres, one per time.")]
Speed = Annotated[
    list[float] | None,
    Field(description="Metres per second along the slope, positive uphill. Only on `include=speed`."),
]
WheelSpeed = Annotated[
    list[float] | None, Field(description="Radians per second, one per time. Only on `include=wheel_speed`.")
]


class ModelIdentity(BaseModel):
    """Which version answered."""

    name: str
    version: int
    alias: Annotated[str | None, Field(description="The alias it was asked for by; null when asked for by number.")]


class ScenarioEcho(BaseModel):
    """The scenario as it was understood, with defaults filled in."""

    slope_deg: float
    mass_kg: float
    torque_nm: Annotated[float, Field(description="Motor stall torque per wheel.")]
    horizon_s: float


class SlopeTrajectory(BaseModel):
    """Positions of the rear wheel's centre along and normal to the slope."""

    time_s: Annotated[list[float], Field(description="Seconds from rest, rising; the last one is the horizon.")]
    x_m: Metres
    y_m: Metres
    speed_m_s: Speed = None
    rear_wheel_speed_rad_s: WheelSpeed = None
    front_wheel_speed_rad_s: WheelSpeed = None


class WorldTrajectory(BaseModel):
    """Positions of the rear wheel's centre, horizontal and up; its speed is along the slope all the same."""

    time_s: Annotated[list[float], Field(description="Seconds from rest, rising; the last one is the horizon.")]
    x_m: Metres
    z_m: Metres
    speed_m_s: Speed = None
    rear_wheel_speed_rad_s: WheelSpeed = None
    front_wheel_speed_rad_s: WheelSpeed = None


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
    """An interval for x and one for y at each time, in the slope frame. For runs like the training runs, it holds the
    position at a share `level` of all times.
    """

    level: Annotated[float, Field(ge=0.5, le=0.99)]
    x_lower_m: Metres
    x_upper_m: Metres
    y_lower_m: Metres
    y_upper_m: Metres


class DomainReason(BaseModel):
    """One input outside the training runs. `torque_ratio` is torque / (mass x gravity x wheel radius).

    `joint` is the combination of all inputs. Its value is `distance`; its highest value is the 99 % quantile of the
    distances from a training run to the nearest other one.
    """

    field: Literal["slope_deg", "mass_kg", "torque_nm", "torque_ratio", "horizon_s", "joint"]
    value: float
    lowest: float
    highest: float
    detail: str


class NearestRun(BaseModel):
    """A training run near the scenario, and the error of its predicted end by a model trained without it."""

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    left_out_final_error_m: Annotated[float | None, Field(ge=0, description="null when it was not measured.")]
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
            "list its runs.",
        ),
    ]
    nearest_runs: Annotated[list[NearestRun], Field(description="The three nearest training runs, nearest first.")]


class SummaryAnswer(BaseModel):
    """The trajectory in six numbers, in the slope frame whatever `frame` is, and the same however it is sampled."""

    outcome: Outcome
    final_x_m: float
    final_y_m: float
    distance_m: Annotated[float, Field(ge=0, description="Length of the path.")]
    mean_speed_m_s: Annotated[float, Field(description="Along the slope; negative downhill.")]
    slip_ratio: Annotated[
        float | None,
        Field(description="1 - mean speed / (wheel radius x mean wheel speed); null where wheels stand still."),
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
