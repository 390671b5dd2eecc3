"""What every encoder is given: the prediction, who made it, and what was asked to be included."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from service.learning.domain import DomainVerdict
from service.physics.scenario import Array
from service.twin import Loaded, Prediction


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """One prediction to write. Prior and band are written whenever it has them: it has none unless asked for."""

    loaded: Loaded
    prediction: Prediction

    def columns(self) -> Mapping[str, Array]:
        """Everything that has one number per time, in the order of a table's columns."""
        columns = dict(self.prediction.trajectory)
        if self.prediction.prior is not None:
            columns |= {f"prior_{name}": values for name, values in self.prediction.prior.items()}
        if self.prediction.band is not None:
            columns |= self.prediction.band.columns()
        return columns

    def model(self) -> dict[str, Any]:
        """Who answered: name, version and the alias that was asked for."""
        return {
            "name": self.loaded.twin.name,
            "version": self.loaded.twin.version,
            "alias": self.loaded.alias,
        }

    def about(self) -> dict[str, Any]:
        """Everything that is no column, under the names of the JSON answer; with the unit of each column.

        What the table-like forms carry beside their columns.
        """
        prediction = self.prediction
        about: dict[str, Any] = {
            "model": self.model(),
            "scenario": prediction.scenario,
            "frame": prediction.frame.value,
            "units": {name: unit_of(name) for name in self.columns()},
            "domain": domain_document(prediction.domain),
            "summary": prediction.summary,
        }
        if prediction.prior is not None:
            about["prior"] = {"name": prediction.prior_name}
        if prediction.band is not None:
            about["band"] = {"level": prediction.band.level}
        return about


def unit_of(column: str) -> str:
    """The unit that stands at the end of a column's name: s, m, m/s or rad/s."""
    for ending, unit in (("_rad_s", "rad/s"), ("_m_s", "m/s")):
        if column.endswith(ending):
            return unit
    return column.rpartition("_")[2]


def domain_document(verdict: DomainVerdict) -> dict[str, Any]:
    """The verdict as every answer shows it; for orjson, which writes the runs' dataclasses as objects."""
    return {
        "inside": verdict.inside,
        "reasons": [asdict(reason) | {"detail": reason.detail} for reason in verdict.reasons],
        "distance": verdict.distance,
        "nearest_runs": verdict.nearest_runs,
    }
