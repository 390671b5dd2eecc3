"""What every encoder is given: the prediction, who made it, and what was asked to be included."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from service.physics.scenario import Array
from service.twin import Loaded, Prediction


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One prediction to write. A band is written whenever the prediction has one: it has none unless asked for."""

    loaded: Loaded
    prediction: Prediction
    with_prior: bool

    def columns(self) -> Mapping[str, Array]:
        """Everything that has one number per time, in the order of a table's columns."""
        columns = dict(self.prediction.trajectory)
        if self.with_prior:
            columns |= {f"prior_{name}": values for name, values in self.prediction.prior.items()}
        if self.prediction.band is not None:
            columns |= self.prediction.band.columns()
        return columns
