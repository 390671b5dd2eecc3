"""Models that answer many scenarios and say what each way comes to in one go."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from service.learning.drive.whole import Whole
from service.physics.scenario import Array, Positions, Scenarios


@runtime_checkable
class KnowsWholes(Protocol):
    """Of its `motion` at times, its horizons and up to two looks it also knows what summaries are made of."""

    def whole_motion(
        self, scenarios: Scenarios, time_s: Array, horizon_s: Array, look_s: Array, *, moving: bool
    ) -> tuple[Positions, Whole]:
        """Times that do not fall, (time,) or (scenario, time); horizons (scenario,). Without `moving` no speeds."""
        ...

    def whole_ways(self, scenarios: Scenarios, horizon_s: Array, look_s: Array) -> Whole:
        """What `whole_motion` says of each way, but for heights and lengths of paths: sooner."""
        ...
