"""What every encoder is given: the prediction, who made it, and what was asked to be included."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from service.physics.scenario import Array
from service.twin import Loaded, Prediction


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One prediction to write."""

    loaded: Loaded
    prediction: Prediction
    with_prior: bool

    def columns(self) -> Mapping[str, Array]:
        """Everything that has one number per time, in the order of a table's columns."""
        if not self.with_prior:
            return self.prediction.trajectory
        prior = {f"prior_{name}": values for name, values in self.prediction.prior.items()}
        return {**self.prediction.trajectory, **prior}
