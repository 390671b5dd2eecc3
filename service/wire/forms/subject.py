"""What every encoder is given: something with columns over time, who made it, and what there is to say beside them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import orjson

from service.learning.domain import DomainReason, DomainVerdict
from service.physics.frames import slope_to_world
from service.physics.scenario import Array
from service.twin import Frame, Loaded, Outcome, Prediction


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """A track seen from the side, metres, horizontal and up: its ground (place,), the way of the rear wheel's centre
    (time,). `rover` is where the rover ends: both wheels' centres as (across, up) and their radius. `marks` are places
    on the way with their names.
    """

    ground_m: tuple[Array, Array]
    way_m: tuple[Array, Array]
    rover: tuple[tuple[float, float], tuple[float, float], float]
    marks: tuple[tuple[float, float, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Picture:
    """How something is drawn against time: a panel for each (column, label of its axis), one below the other.

    A column with `<stem>_lower_m` and `<stem>_upper_m` beside it gets its band, one with `prior_` before its name the
    prior's. `marks` are moments (s) with their names. `held` are columns that keep their value until the next time,
    `shaded` is a column of true and false: where it is true the panels are shaded. `hatched` are times (s), from and
    to, outside the domain. `description` says what is seen to who cannot see it. `side` is drawn above the panels.
    """

    title: str
    panels: tuple[tuple[str, str], ...]
    marks: tuple[tuple[float, str], ...] = ()
    held: tuple[str, ...] = ()
    shaded: str = ""
    hatched: tuple[tuple[float, float], ...] = ()
    description: str = ""
    side: Side | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """How something moves on a stage: `across_m` and `up_m` (time,) are its positions in the world frame.

    `pitch_deg` is the rover's, of one number or (time,); `doc` says what moves.
    """

    across_m: Array
    up_m: Array
    pitch_deg: Array
    doc: str


class Writable(Protocol):
    """What has columns over time: a prediction, a drive."""

    def columns(self) -> Mapping[str, npt.NDArray[Any]]:
        """Everything that has one number, or one true or false, per time, in the order of a table's columns."""
        ...

    def scalars(self) -> Mapping[str, object]:
        """What was computed besides, by its place in the answer: to be looked through for numbers that are none."""
        ...

    def about(self) -> dict[str, Any]:
        """Everything that is no column, under the names of the JSON answer; with the unit of each column.

        What the table-like forms carry beside their columns. One of it may be text: the frame.
        """
        ...

    def headers(self) -> dict[str, str]:
        """The response headers that say what a body may not."""
        ...

    def picture(self) -> Picture:
        """As a plot."""
        ...

    def stage(self) -> Stage:
        """As something that moves."""
        ...


ColumnTexts = Mapping[str, Mapping[str, orjson.Fragment]]
"""Columns by group and name, each as a JSON list."""

_AXIS_LABELS = {
    "x_m": {"slope": "x, m\nalong the slope", "world": "x, m\nhorizontal"},
    "y_m": {"slope": "y, m\nnormal to the slope"},
    "z_m": {"world": "z, m\nup"},
}


@dataclass(slots=True, eq=False)
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

    def scalars(self) -> Mapping[str, object]:
        """The summary. The verdict follows from the question and from the manifest, whose numbers are finite."""
        return {"summary": self.prediction.summary}

    def headers(self) -> dict[str, str]:
        """Model, frame, domain, outcome and the band's level, if there is one."""
        prediction, twin = self.prediction, self.loaded.twin.manifest
        known = _headers(
            twin.name, twin.version, prediction.frame, prediction.domain.inside, prediction.summary.outcome
        )
        level = {} if prediction.band is None else {"Rover-Twin-Band-Level": f"{prediction.band.level:.12g}"}
        return known | level

    def picture(self) -> Picture:
        """x above, y or z below."""
        prediction, twin = self.prediction, self.loaded.twin
        scenario, frame = prediction.scenario, prediction.frame
        outside = "" if prediction.domain.inside else ", OUTSIDE the domain: extrapolated"
        band = "" if prediction.band is None else f", band {prediction.band.level:.3g}"
        title = (
            f"{scenario.slope_deg:g}° slope, {scenario.mass_kg:g} kg, {scenario.torque_nm:g} N m: "
            f"{prediction.summary.outcome}{outside}\n{twin.name}@{twin.version}, {frame} frame{band}"
        )
        panels = tuple((name, _AXIS_LABELS[name][frame]) for name in prediction.position_names)
        return Picture(title, panels, description=self._told())

    def _told(self) -> str:
        """What the picture shows, in sentences."""
        found = self.prediction.summary
        known = "inside" if self.prediction.domain.inside else "outside"
        return (
            f"Position against time for {self.prediction.scenario.horizon_s:g} s. The rover {found.outcome.value}: "
            f"it ends at {found.final_x_m:.3g} m along the slope, with a mean speed of {found.mean_speed_m_s:.3g} m/s. "
            f"The scenario is {known} the model's domain."
        )

    def stage(self) -> Stage:
        """The world in both frames."""
        prediction, twin = self.prediction, self.loaded.twin
        across, up = (prediction.trajectory[name] for name in prediction.position_names)
        slope_deg = prediction.scenario.slope_deg
        if prediction.frame is Frame.SLOPE:
            across, up = slope_to_world(across, up, math.radians(slope_deg))
        doc = f"{twin.name}@{twin.version}: rear wheel's centre of a rover on a slope; "
        return Stage(across, up, np.array([slope_deg]), f"{doc}columns in the {prediction.frame} frame")

    def about(self) -> dict[str, Any]:
        """Everything that is no column, under the names of the JSON answer; with the unit of each column.

        What the table-like forms carry beside their columns.
        """
        prediction = self.prediction
        about: dict[str, Any] = {
            "model": model_of(self.loaded),
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


def model_of(loaded: Loaded) -> dict[str, Any]:
    """Who answered: name, version and the alias that was asked for."""
    return {"name": loaded.twin.name, "version": loaded.twin.version, "alias": loaded.alias}


@lru_cache(maxsize=256)
def _headers(name: str, version: int, frame: Frame, inside: bool, outcome: Outcome) -> dict[str, str]:
    """Nobody changes what is found."""
    return {**_headers_of(name, version, frame, inside), "Rover-Twin-Outcome": outcome.value}


def headers_of(loaded: Loaded, frame: Frame, inside: bool) -> dict[str, str]:
    """Model, frame and domain as response headers."""
    return _headers_of(loaded.twin.name, loaded.twin.version, frame, inside)


def _headers_of(name: str, version: int, frame: Frame, inside: bool) -> dict[str, str]:
    return {
        "Rover-Twin-Model": f"{name}@{version}",
        "Rover-Twin-Frame": frame.value,
        "Rover-Twin-Domain": "inside" if inside else "outside",
    }


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
        "reasons": reasons_document(verdict.reasons),
        "distance": verdict.distance,
        "nearest_runs": verdict.nearest_runs,
    }


def reasons_document(reasons: Iterable[DomainReason]) -> list[dict[str, Any]]:
    """What is outside, each with its sentence."""
    return [asdict(reason) | {"detail": reason.detail} for reason in reasons]
