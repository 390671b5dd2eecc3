"""The answer to one scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from service.errors import RoverTwinError
from service.learning.domain import DomainVerdict
from service.physics.scenario import Array
from service.twin.scenario import Scenario
from service.twin.summary import Summary

SPEED_NAMES = ("speed_m_s", "rear_wheel_speed_rad_s", "front_wheel_speed_rad_s")
"""Columns that a trajectory has on request."""


class Frame(StrEnum):
    """The frame of positions: `slope` has x_m along and y_m normal to the slope, `world` x_m horizontal and z_m up."""

    SLOPE = "slope"
    WORLD = "world"


class NonFiniteError(RoverTwinError):
    """The model gave NaN or infinity for a scenario; such an answer is never handed out."""


class OutsideDomainError(RoverTwinError):
    """A strict request is outside the domain of the model that would answer."""

    def __init__(self, model: str, verdict: DomainVerdict) -> None:
        self.verdict = verdict
        reasons = "; ".join(reason.detail for reason in verdict.reasons)
        super().__init__(f"the scenario is outside the domain of {model}: {reasons}")


@dataclass(frozen=True, slots=True, eq=False)
class PredictionBand:
    """Where the truth lies with probability `level` at each time, pointwise; slope frame, m.

    Bounds have shape (time,), in a batch (scenario, time).
    """

    level: float
    x_lower_m: Array
    x_upper_m: Array
    y_lower_m: Array
    y_upper_m: Array

    def columns(self) -> Mapping[str, Array]:
        """The four bounds by name."""
        return {name: getattr(self, name) for name in ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")}


@dataclass(slots=True, eq=False)
class Prediction:
    """One trajectory, domain verdict and summary; on request speeds, the prior alone and a band. Nobody changes one.

    `trajectory` maps time_s, x_m and y_m (world frame: z_m) to arrays of shape (time,), s and m, and on request
    speed_m_s, rear_wheel_speed_rad_s and front_wheel_speed_rad_s, in both frames along the slope. `prior` maps the two
    positions of the prior alone likewise. `summary` is in the slope frame whatever `frame` is. All finite.
    """

    scenario: Scenario
    frame: Frame
    trajectory: dict[str, Array]
    prior_name: str
    prior: Mapping[str, Array] | None
    domain: DomainVerdict
    summary: Summary
    band: PredictionBand | None = None

    @property
    def position_names(self) -> tuple[str, str]:
        """The two columns of the trajectory that say where the rover is."""
        return ("x_m", "y_m") if self.frame is Frame.SLOPE else ("x_m", "z_m")
