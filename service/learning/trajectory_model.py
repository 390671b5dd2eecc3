"""What a twin needs of a model, whatever is inside it. Neither this nor a model without a network imports torch."""

from __future__ import annotations

from typing import Protocol

from service.physics.prior import Prior
from service.physics.scenario import Array, Positions, Scenarios


class TrajectoryModel(Protocol):
    """What a twin needs of a model: trajectories of scenarios, and the prior that they are compared with."""

    @property
    def prior(self) -> Prior:
        """The physics that the model starts from; it holds rover and regolith."""
        ...

    @property
    def quick(self) -> bool:
        """Whether a scenario takes well under a millisecond, at 20,000 times too."""
        ...

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions (m), shape (scenario, time), at `time_s` of shape (time,) or (scenario, time).

        One array operation over many scenarios, or almost: what a scenario gets depends on the others by rounding only
        (of float32 where a network answers), and besides the answer memory is bounded however many there are.
        """
        ...
