"""What every encoder of a batch is given: many predictions, or drives, in columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from service.learning.domain import FIELDS
from service.physics.scenario import Array
from service.twin import SPEED_NAMES, Frame, Loaded, PredictionBatch
from service.wire.batch_forms.verdicts import verdict_cells
from service.wire.forms.numbers import column_of_lines, column_text, dump_finite
from service.wire.forms.subject import Subject, Writable, unit_of
from service.wire.lines import Cells

Column = npt.NDArray[Any] | Sequence[Any]
_SCENARIO_FIELDS = ("slope_deg", "mass_kg", "torque_nm", "horizon_s")
_SUMMARY_FIELDS = ("outcome", "final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio")
_BOUNDS = ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")


class BatchWritable(Protocol):
    """Many of what has columns over time, those that could be answered in order."""

    @property
    def index_name(self) -> str:
        """What one of them is called."""
        ...

    @property
    def indices(self) -> npt.NDArray[np.intp]:
        """Their places among all that were sent, (row,), rising."""
        ...

    @property
    def failures(self) -> Sequence[Mapping[str, Any]]:
        """The problems of the others, each with its `index`."""
        ...

    def time_s(self) -> Array:
        """Shape (time,) where all share it, else (row, time)."""
        ...

    def counts(self) -> npt.NDArray[np.intp]:
        """How many points of each row are its own, shape (row,)."""
        ...

    def groups(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        """`trajectory` and what else was asked for: columns of shape (row, time)."""
        ...

    def columns(self) -> Mapping[str, npt.NDArray[Any]]:
        """The same as one table; the names are those of a single answer's."""
        ...

    def tables(self) -> dict[str, dict[str, Column]]:
        """Columns with one entry for each row, in groups."""
        ...

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The same as arrays, where they can be."""
        ...

    def extras(self) -> dict[str, Any]:
        """Lists with an entry for each row that are no columns."""
        ...

    def about(self) -> dict[str, Any]:
        """Everything that is not by row or by time."""
        ...

    def answers(self) -> dict[str, Any]:
        """What the single route answers to each, as one document with an `index`: where they differ, its values are
        `Lists` and `Cells`. There is one at least.
        """
        ...

    def one(self, row: int) -> Writable:
        """One of them alone."""
        ...

    def headers(self) -> dict[str, str]:
        """As response headers."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class BatchSubject:
    """Many predictions to write, `indices` (row,) their places among the scenarios that were sent, rising.

    `batch` is None where nothing could be answered; `failures` are the problems of the others, each with its `index`.
    """

    loaded: Loaded
    frame: Frame
    batch: PredictionBatch | None
    indices: npt.NDArray[np.intp]
    failures: Sequence[Mapping[str, Any]]
    with_prior: bool
    with_band: bool
    with_speed: bool = False
    with_wheel_speed: bool = False

    @property
    def index_name(self) -> str:
        """What one of them is called."""
        return "scenario"

    @property
    def names(self) -> tuple[str, ...]:
        """Of the positions in this frame."""
        return ("x_m", "y_m") if self.frame is Frame.SLOPE else ("x_m", "z_m")

    @property
    def speeds(self) -> tuple[str, ...]:
        """Names of the speeds that were asked for."""
        return (*SPEED_NAMES[:1] * self.with_speed, *SPEED_NAMES[1:] * self.with_wheel_speed)

    def time_s(self) -> Array:
        """Shape (time,) where all scenarios share it, else (scenario, time)."""
        return np.empty(0) if self.batch is None else self.batch.time_s

    def counts(self) -> npt.NDArray[np.intp]:
        """How many points of each row are its own, shape (scenario,)."""
        return np.empty(0, dtype=np.intp) if self.batch is None else self.batch.counts

    def groups(self) -> dict[str, Mapping[str, Array]]:
        """`trajectory`, and `prior` and `band` where asked for: columns of shape (scenario, time)."""
        if self.batch is None:
            nothing = np.empty((0, 0))
            prior = {"prior": dict.fromkeys(self.names, nothing)} if self.with_prior else {}
            band = {"band": dict.fromkeys(_BOUNDS, nothing)} if self.with_band else {}
            return {"trajectory": dict.fromkeys((*self.names, *self.speeds), nothing), **prior, **band}
        groups = {"trajectory": self.batch.trajectory}
        if self.batch.prior is not None:
            groups["prior"] = self.batch.prior
        if self.batch.band is not None:
            groups["band"] = self.batch.band.columns()
        return groups

    def columns(self) -> dict[str, Array]:
        """The same as one table; the names are those of a single prediction's."""
        groups = self.groups()
        prior = {f"prior_{name}": column for name, column in groups.get("prior", {}).items()}
        return {**groups["trajectory"], **prior, **groups.get("band", {})}

    def tables(self) -> dict[str, dict[str, Column]]:
        """`scenarios`, `domain` and `summary`: columns with one entry for each scenario that is answered.

        Numbers are arrays, the others tuples: these hold nothing that could be no number.
        """
        if self.batch is None:
            nothing: dict[str, Column] = {name: [] for name in (*_SCENARIO_FIELDS, "points")}
            return {
                "scenarios": {"index": self.indices, **nothing},
                "domain": {"inside": [], "outside_of": []},
                "summary": {name: [] for name in _SUMMARY_FIELDS},
            }
        values = self.batch.domain.values  # in the order of FIELDS
        asked = {name: _whole(values[:, FIELDS.index(name)]) for name in _SCENARIO_FIELDS}
        summaries = self.batch.summaries
        return {
            "scenarios": {"index": self.indices, **asked, "points": self.batch.counts},
            "domain": self._domain(self.batch),
            "summary": {name: _whole(getattr(summaries, name)) for name in _SUMMARY_FIELDS},
        }

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The same as arrays. `outside_of` has names with commas between them; `slip_ratio` is that of scenarios where
        `slip_ratio_known`.
        """
        tables = self.tables()
        by_scenario: dict[str, Any] = {**tables["scenarios"], **tables["domain"], **tables["summary"]}
        slips = by_scenario["slip_ratio"]
        by_scenario["slip_ratio"] = np.array([0.0 if slip is None else slip for slip in slips], dtype=np.float64)
        by_scenario["slip_ratio_known"] = np.array([slip is not None for slip in slips], dtype=np.bool_)
        by_scenario["outside_of"] = np.array([",".join(names) for names in by_scenario["outside_of"]], dtype=np.str_)
        by_scenario["outcome"] = np.array([str(outcome) for outcome in by_scenario["outcome"]], dtype=np.str_)
        return {name: np.asarray(column) for name, column in by_scenario.items()}

    def extras(self) -> dict[str, Any]:
        """None."""
        return {}

    def answers(self) -> dict[str, Any]:
        """`service.wire.prediction_answer.PredictionAnswer`. Raises ValueError where nothing could be answered."""
        if self.batch is None:
            raise ValueError("nothing could be answered")
        about, tables = self.about(), self.tables()
        groups = groups_of_lines(self, about)
        return {
            "index": _cells(self.indices),
            "model": about["model"],
            "scenario": {name: _cells(tables["scenarios"][name]) for name in _SCENARIO_FIELDS},
            "frame": about["frame"],
            **groups,
            "domain": verdict_cells(self.batch.domain),
            "summary": {name: _cells(column) for name, column in tables["summary"].items()},
        }

    def one(self, row: int) -> Subject:
        """One of them alone. Raises IndexError where nothing could be answered."""
        if self.batch is None:
            raise IndexError(row)
        return Subject(self.loaded, self.batch[row])

    @staticmethod
    def _domain(batch: PredictionBatch) -> dict[str, Column]:
        verdicts = batch.domain
        columns: dict[str, Column] = {"inside": verdicts.inside, "outside_of": tuple(verdicts.outside_of())}
        known = verdicts.domain.neighbourhood
        if verdicts.nearest is not None and known is not None:
            order, distances = verdicts.nearest
            columns["distance"] = _whole(distances[:, 0])
            columns["nearest_run"] = tuple(known.runs[at].run for at in order[:, 0].tolist())
        return columns

    def about(self) -> dict[str, Any]:
        """Everything that is not by scenario or by time: model, frame, units; names of prior and band; errors."""
        twin = self.loaded.twin
        names = ("time_s", *self.columns())
        about: dict[str, Any] = {
            "model": {"name": twin.name, "version": twin.version, "alias": self.loaded.alias},
            "frame": self.frame.value,
            "units": {name: unit_of(name) for name in names},
            "errors": self.failures,
        }
        if self.batch is not None and self.batch.prior is not None:
            about["prior"] = {"name": self.batch.prior_name}
        if self.batch is not None and self.batch.band is not None:
            about["band"] = {"level": self.batch.band.level}
        return about

    def headers(self) -> dict[str, str]:
        """Model, frame and how many scenarios failed, as response headers."""
        twin = self.loaded.twin
        return {
            "Rover-Twin-Model": f"{twin.name}@{twin.version}",
            "Rover-Twin-Frame": self.frame.value,
            "Rover-Twin-Failed": str(len(self.failures)),
        }


def _whole(column: Column) -> Column:
    """orjson wants arrays without gaps."""
    return np.ascontiguousarray(column) if isinstance(column, np.ndarray) else column


def groups_of_lines(subject: BatchWritable, about: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The groups of a single answer with what `about` says of them, for lines; the trajectory is the first of them."""
    counts, time = subject.counts(), subject.time_s()
    times = column_text("time_s", time) if time.ndim == 1 else column_of_lines("time_s", time, counts)
    found: dict[str, dict[str, Any]] = {"trajectory": {"time_s": times}}
    for group, columns in subject.groups().items():
        written = {name: column_of_lines(name, each, counts) for name, each in columns.items()}
        found[group] = {**about.get(group, {}), **found.get(group, {}), **written}
    return found


def _cells(column: Column) -> Cells:
    """Of a column whose values have no commas."""
    return Cells.listed(dump_finite(column))
