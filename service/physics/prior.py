"""What every prior offers: positions in closed form, the right-hand side they solve, one coefficient to calibrate."""

from __future__ import annotations

from typing import ClassVar, Protocol, Self

from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Positions, Scenarios


class Prior(Protocol):
    """A closed-form solution of a simple equation of motion along the slope, starting at rest at the origin.

    `coefficient` is the one empirical number; positions are an affine function of it, so that the
    least-squares calibration on runs is a single division (`service.learning.calibration`).
    """

    name: ClassVar[str]
    coefficient_name: ClassVar[str]

    @property
    def rover(self) -> RoverParameters:
        """Geometry and drive that the prior was made with."""
        ...

    @property
    def regolith(self) -> RegolithParameters:
        """Gravity and soil that the prior was made with."""
        ...

    @property
    def coefficient(self) -> float:
        """The one empirical number, dimensionless."""
        ...

    def with_coefficient(self, coefficient: float) -> Self:
        """The same prior with another value of its empirical coefficient."""
        ...

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions at `time_s` (s), of shape (time,) or (scenario, time); the answer has shape (scenario, time)."""
        ...

    def acceleration_m_s2(self, scenarios: Scenarios, speed_m_s: Array) -> Array:
        """Right-hand side dv/dt that `positions` solves; `speed_m_s` and the answer have shape (scenario,)."""
        ...
