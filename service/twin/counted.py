"""A twin whose predictions somebody counts."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields

from service.physics.scenario import Array
from service.twin.batch import PredictionBatch
from service.twin.prediction import Frame, Prediction
from service.twin.scenario import Scenario
from service.twin.summary import Outcome
from service.twin.twin import Twin

Count = Callable[[Twin, float, Sequence[Outcome], int], None]
"""Is told, on the thread that predicts, which twin took how long (s), the outcomes, and how many are outside."""


@dataclass(frozen=True, slots=True, eq=False)
class CountedTwin(Twin):
    """Tells `count` of everything it predicted."""

    count: Count = field(kw_only=True)

    @classmethod
    def of(cls, twin: Twin, count: Count) -> CountedTwin:
        """The same twin, counted."""
        return cls(**{each.name: getattr(twin, each.name) for each in fields(Twin) if each.init}, count=count)

    def predict(
        self,
        scenario: Scenario,
        time_s: Array,
        frame: Frame = Frame.SLOPE,
        band_level: float | None = None,
        *,
        with_prior: bool = False,
    ) -> Prediction:
        """`Twin.predict`."""
        began = time.perf_counter()
        found = Twin.predict(self, scenario, time_s, frame, band_level, with_prior=with_prior)
        self.count(self, time.perf_counter() - began, (found.summary.outcome,), int(not found.domain.inside))
        return found

    def predict_many(
        self,
        scenarios: Sequence[Scenario],
        time_s: Array,
        frame: Frame = Frame.SLOPE,
        band_level: float | None = None,
        *,
        with_prior: bool = False,
    ) -> PredictionBatch:
        """`Twin.predict_many`."""
        began = time.perf_counter()
        batch = Twin.predict_many(self, scenarios, time_s, frame, band_level, with_prior=with_prior)
        outside = len(batch) - int(batch.domain.inside.sum())
        self.count(self, time.perf_counter() - began, batch.summaries.outcome, outside)
        return batch
