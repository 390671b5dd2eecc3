"""Many drives to write, in every form that a batch of predictions has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array
from service.twin import Frame, Loaded
from service.twin.drives import Drive
from service.wire.batch_forms.subject import Column, groups_of_lines
from service.wire.drives.subject import DriveSubject, domain_of, unit_of_drive
from service.wire.forms.numbers import dump
from service.wire.forms.subject import model_of
from service.wire.lines import Cells

_NUMBERS = (
    "motor_energy_j",
    "steepest_slope_deg",
    "steepest_at_m",
    "final_x_m",
    "final_y_m",
    "distance_m",
    "mean_speed_m_s",
    "duration_s",
)
_MAYBE = ("arrival_time_s", "arrival_earliest_s", "arrival_latest_s")
_CHANCES = ("passes", "sticks", "slides")
_BOUNDS = ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")


@dataclass(frozen=True, slots=True, eq=False)
class DriveBatchSubject:
    """`drives` are those that could be answered, `indices` (row,) their places among those that were sent, rising;
    `failures` are the problems of the others, each with its `index`. A `BatchWritable`.
    """

    loaded: Loaded
    frame: Frame
    drives: Sequence[Drive]
    indices: npt.NDArray[np.intp]
    failures: Sequence[Mapping[str, Any]]
    band_level: float | None

    @property
    def index_name(self) -> str:
        """What one of them is called."""
        return "drive"

    def time_s(self) -> Array:
        """Shape (time,) where all drives share it, else (drive, time)."""
        columns = [each.trajectory["time_s"] for each in self.drives]
        if columns and all(np.array_equal(columns[0], each) for each in columns[1:]):
            return columns[0]
        return self._filled(columns)

    def counts(self) -> npt.NDArray[np.intp]:
        """How many points of each row are its own, shape (drive,)."""
        return np.array([len(each.trajectory["time_s"]) for each in self.drives], dtype=np.intp)

    def groups(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        """`trajectory`, and `band` where asked for: columns of shape (drive, time)."""
        names = [name for name in self.drives[0].trajectory if name != "time_s"] if self.drives else []
        groups: dict[str, Mapping[str, npt.NDArray[Any]]] = {
            "trajectory": {name: self._filled([each.trajectory[name] for each in self.drives]) for name in names}
        }
        if self.band_level is not None:
            bands = [each.band.columns() for each in self.drives if each.band is not None]
            groups["band"] = {name: self._filled([each[name] for each in bands]) for name in _BOUNDS}
        return groups

    def columns(self) -> Mapping[str, npt.NDArray[Any]]:
        """The same as one table."""
        groups = self.groups()
        return {**groups["trajectory"], **groups.get("band", {})}

    def tables(self) -> dict[str, dict[str, Column]]:
        """`drives`, `domain` and `summary`: columns with one entry for each drive that is answered."""
        echoes = [self.one(row).echo() for row in range(len(self.drives))]
        names = ("mass_kg", "knots", "controls", "start_speed_m_s", "horizon_s", "until_distance_m")
        summaries = [each.summary for each in self.drives]
        chances = [each.probabilities for each in summaries]
        return {
            "drives": {
                "index": self.indices,
                **{name: [echo[name] for echo in echoes] for name in names},
                "points": self.counts(),
            },
            "domain": {"inside": [each.domain.inside for each in self.drives]},
            "summary": {
                "outcome": [each.outcome for each in summaries],
                **{f"probability_{name}": [each and getattr(each, name) for each in chances] for name in _CHANCES},
                **{name: [getattr(each, name) for each in summaries] for name in (*_MAYBE, *_NUMBERS)},
            },
        }

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The same as arrays. What a drive has not is 0 there, and false in `<name>_known`."""
        tables = self.tables()
        found: dict[str, npt.NDArray[Any]] = {}
        for name, column in {**tables["drives"], **tables["domain"], **tables["summary"]}.items():
            values = list(column)
            if name in (*_MAYBE, "start_speed_m_s", "until_distance_m", *(f"probability_{each}" for each in _CHANCES)):
                found[f"{name}_known"] = np.array([value is not None for value in values], dtype=np.bool_)
                found[name] = np.array([0.0 if value is None else value for value in values], dtype=np.float64)
            elif name == "outcome":
                found[name] = np.array([str(value) for value in values], dtype=np.str_)
            else:
                found[name] = np.asarray(column)
        return found

    def extras(self) -> dict[str, Any]:
        """Events and stretches of each drive."""
        return {
            "events": [each.events for each in self.drives],
            "events_left_out": [each.events_left_out for each in self.drives],
            "stretches": [domain_of(each.domain)["stretches"] for each in self.drives],
        }

    def about(self) -> dict[str, Any]:
        """Everything that is not by drive or by time: model, frame, units, level of the band, errors."""
        band = {} if self.band_level is None else {"band": {"level": self.band_level}}
        return {
            "model": model_of(self.loaded),
            "frame": self.frame.value,
            "units": {name: unit_of_drive(name) for name in ("time_s", *self.columns())},
            "errors": self.failures,
            **band,
        }

    def answers(self) -> dict[str, Any]:
        """`service.wire.drives.answer.DriveAnswer` of each, for lines."""
        about, rest = self.about(), [self.one(row).rest() for row in range(len(self.drives))]
        names = rest[0] if rest else ()
        return {
            "index": Cells.listed(dump(self.indices)),
            "model": about["model"],
            "drive": Cells.of([dump(self.one(row).echo()) for row in range(len(self.drives))]),
            "frame": about["frame"],
            **groups_of_lines(self, about),
            **{name: Cells.of([dump(each[name]) for each in rest]) for name in names},
        }

    def one(self, row: int) -> DriveSubject:
        """One of them alone."""
        return DriveSubject(self.loaded, self.drives[row])

    def headers(self) -> dict[str, str]:
        """Model, frame and how many drives failed, as response headers."""
        twin = self.loaded.twin
        return {
            "Rover-Twin-Model": f"{twin.name}@{twin.version}",
            "Rover-Twin-Frame": self.frame.value,
            "Rover-Twin-Failed": str(len(self.failures)),
        }

    @staticmethod
    def _filled(rows: Sequence[npt.NDArray[Any]]) -> npt.NDArray[Any]:
        """Rows of one length, (drive, time): each goes on with its last value."""
        if not rows:
            return np.empty((0, 0))
        longest = max(map(len, rows))
        return np.stack([np.pad(row, (0, longest - len(row)), mode="edge") for row in rows])
