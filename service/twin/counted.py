"""A twin whose predictions somebody counts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields

from service.physics.scenario import Array
from service.twin.batch import PredictionBatch
from service.twin.prediction import Frame
from service.twin.scenario import Scenario
from service.twin.twin import Twin

Count = Callable[[PredictionBatch, Twin, float], None]
"""Is told of predictions, the twin that made them and how long (s) they took; on the thread that made them."""


@dataclass(frozen=True, slots=True, eq=False)
class CountedTwin(Twin):
    """Tells `count` of everything it predicted."""

    count: Count = field(kw_only=True)

    @classmethod
    def of(cls, twin: Twin, count: Count) -> CountedTwin:
        """The same twin, counted."""
        return cls(**{each.name: getattr(twin, each.name) for each in fields(Twin)}, count=count)

    def predict_many(
        self,
        scenarios: Sequence[Scenario],
        time_s: Array,
        frame: Frame = Frame.SLOPE,
        band_level: float | None = None,
    ) -> PredictionBatch:
        """`Twin.predict_many`."""
        began = time.perf_counter()
        batch = Twin.predict_many(self, scenarios, time_s, frame, band_level)
        self.count(batch, self, time.perf_counter() - began)
        return batch
