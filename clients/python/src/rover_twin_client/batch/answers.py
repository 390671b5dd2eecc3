"""Many predictions in columns, as `predict_batch` answers them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias, overload

import numpy as np

from rover_twin_client.answers import (
    SPEEDS,
    Array,
    Band,
    Domain,
    DomainReason,
    Flags,
    Frame,
    ModelIdentity,
    Prediction,
    Prior,
    Scenario,
    Summary,
    Words,
)
from rover_twin_client.errors import FieldFault, InvalidInputError
from rover_twin_client.shown import Facts, Line, Plotted, Table, plots, tables
from rover_twin_client.shown.facts import Variable

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import xarray as xr
    from matplotlib.axes import Axes

Per: TypeAlias = Literal["scenario", "time"]
ASKED = ("slope_deg", "mass_kg", "torque_nm", "horizon_s")
"""What a scenario is."""
_SUMMARY = ("outcome", "final_x_m", "final_y_m", "distance_m", "mean_speed_m_s", "slip_ratio")
_DOMAIN = ("inside", "outside_of", "distance", "nearest_run")
TABLE_COLUMNS = frozenset({"scenario", *_SUMMARY, *_DOMAIN, "error"})
"""What the table of a batch has beside the scenario itself."""
_LISTED = 5


@dataclass(frozen=True, slots=True)
class FailedPrediction:
    """One scenario of a batch that was refused: its place among those sent, and what is wrong with it."""

    index: int
    detail: str
    faults: tuple[FieldFault, ...]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Batch(Plotted, Sequence[Prediction | FailedPrediction]):
    """Predictions of N scenarios, in the order in which they were sent, all from one version.

    Arrays (N, T) have a row for each scenario and a column for each time; arrays (N,) an entry for each scenario.
    `time_s` is (T,) when all scenarios share it, else (N, T). A row is NaN after its horizon, and as a whole for a
    scenario that was refused: `failures` says why. There `outcome` is empty and `inside` false.

    `prior` and `band` have arrays (N, T); they and the speeds are None unless included. `slip_ratio` is NaN where it is
    not known. `outside_of` names the inputs outside the domain, with commas between them; `distance` is that to
    `nearest_run`, a training run.

    `batch[i]` is one `Prediction`, or a `FailedPrediction`. Its `domain` names no bounds and lists no runs: ask
    `predict` for them.
    """

    model: ModelIdentity
    frame: Frame
    slope_deg: Array
    mass_kg: Array
    torque_nm: Array
    horizon_s: Array
    time_s: Array
    x_m: Array
    y_m: Array | None
    z_m: Array | None
    speed_m_s: Array | None
    rear_wheel_speed_rad_s: Array | None
    front_wheel_speed_rad_s: Array | None
    prior: Prior | None
    band: Band | None
    outcome: Words
    final_x_m: Array
    final_y_m: Array
    distance_m: Array
    mean_speed_m_s: Array
    slip_ratio: Array
    inside: Flags
    outside_of: Words
    distance: Array
    nearest_run: Words
    failures: tuple[FailedPrediction, ...]

    def __len__(self) -> int:
        return int(self.slope_deg.size)

    @overload
    def __getitem__(self, at: int) -> Prediction | FailedPrediction: ...
    @overload
    def __getitem__(self, at: slice) -> list[Prediction | FailedPrediction]: ...
    def __getitem__(self, at: int | slice) -> Prediction | FailedPrediction | list[Prediction | FailedPrediction]:
        if isinstance(at, slice):
            return [self[each] for each in range(*at.indices(len(self)))]
        row = range(len(self))[at]
        return self._one(row) if self.outcome[row] else self._failure(row)

    def __iter__(self) -> Iterator[Prediction | FailedPrediction]:
        failed = {failure.index: failure for failure in self.failures}
        return (failed[row] if row in failed else self._one(row) for row in range(len(self)))

    @property
    def predictions(self) -> list[Prediction]:
        """The predictions of those scenarios that were not refused."""
        return [self._one(row) for row in np.flatnonzero(self.outcome != "").tolist()]

    def to_pandas(self, per: Per = "scenario") -> pd.DataFrame:
        """One row for each scenario: what was asked, outcome, domain, `error`. Or one for each scenario and time.

        `per="time"` has the columns of a single prediction, after `scenario`, its place in the batch.
        """
        return tables.to_pandas(self._table(per))

    def to_polars(self, per: Per = "scenario") -> pl.DataFrame:
        """The same as `to_pandas` for polars."""
        return tables.to_polars(self._table(per))

    def to_xarray(self) -> xr.Dataset:
        """All arrays over the axes `scenario` and `time_s`, or `point` where scenarios have times of their own."""
        return tables.to_xarray(self._table("scenario"))

    def plot(self, column: str = "x_m", ax: Axes | None = None) -> Axes:
        """Plots one column of all scenarios over time (matplotlib).

        `ax` are the axes to draw on, by default those of a new figure. Returns the axes.
        """
        return plots.many_over_time(ax, self._said(), self.time_s, column, plots.chosen(self._over_time(), column))

    def _one(self, row: int) -> Prediction:
        time_s = self.time_s if self.time_s.ndim == 1 else self.time_s[row][np.isfinite(self.time_s[row])]
        points = time_s.size

        def own(column: Array | None) -> Array | None:
            return None if column is None else column[row, :points]

        prior, band = self.prior, self.band
        return Prediction(
            model=self.model,
            scenario=Scenario(*(float(getattr(self, name)[row]) for name in ASKED)),
            frame=self.frame,
            time_s=time_s,
            x_m=self.x_m[row, :points],
            y_m=own(self.y_m),
            z_m=own(self.z_m),
            prior=prior and Prior(prior.name, prior.x_m[row, :points], own(prior.y_m), own(prior.z_m)),
            domain=self._domain(row),
            summary=self._summary(row),
            band=band and Band(band.level, *(column[row, :points] for column in band.columns().values())),
            speed_m_s=own(self.speed_m_s),
            rear_wheel_speed_rad_s=own(self.rear_wheel_speed_rad_s),
            front_wheel_speed_rad_s=own(self.front_wheel_speed_rad_s),
        )

    def _summary(self, row: int) -> Summary:
        slip_ratio = float(self.slip_ratio[row])
        return Summary(
            outcome=str(self.outcome[row]),
            final_x_m=float(self.final_x_m[row]),
            final_y_m=float(self.final_y_m[row]),
            distance_m=float(self.distance_m[row]),
            mean_speed_m_s=float(self.mean_speed_m_s[row]),
            slip_ratio=None if np.isnan(slip_ratio) else slip_ratio,
        )

    def _domain(self, row: int) -> Domain:
        distance = float(self.distance[row])
        known = {name: float(getattr(self, name)[row]) for name in ASKED} | {"joint": distance}
        names = [name for name in str(self.outside_of[row]).split(",") if name]
        reasons = (
            DomainReason(name, known.get(name, np.nan), None, None, f"{name} is outside the domain of {self.model}")
            for name in names
        )
        return Domain(bool(self.inside[row]), tuple(reasons), None if np.isnan(distance) else distance)

    def _failure(self, row: int) -> FailedPrediction:
        return next(failure for failure in self.failures if failure.index == row)

    def _over_time(self) -> dict[str, Array]:
        """Columns (N, T) by the names of a single prediction's table."""
        own = {name: getattr(self, name) for name in ("x_m", "y_m", "z_m", *SPEEDS)}
        prior = {} if self.prior is None else self.prior.columns()
        band = {} if self.band is None else self.band.columns()
        return {name: column for name, column in (own | prior | band).items() if column is not None}

    def _table(self, per: Per) -> Table:
        if per not in ("scenario", "time"):
            message = f"per is {per!r}, allowed is 'scenario' or 'time'"
            raise InvalidInputError(message, faults=(FieldFault("per", per, "'scenario' or 'time'", message),))
        over_time = self._over_time()
        asked = {name: getattr(self, name) for name in ASKED}
        found = {name: getattr(self, name) for name in (*_SUMMARY, *_DOMAIN)}
        axis = "time_s" if self.time_s.ndim == 1 else "point"
        both, number = ("scenario", axis), np.arange(len(self))
        time_axes = (axis,) if self.time_s.ndim == 1 else both
        coordinates: dict[str, Variable] = {"scenario": (("scenario",), number), "time_s": (time_axes, self.time_s)}
        variables: dict[str, Variable] = {name: (("scenario",), column) for name, column in found.items()}
        return Table(
            columns=self._long(over_time)
            if per == "time"
            else {"scenario": number, **asked, **found, **self._errors()},
            variables=variables | {name: (both, column) for name, column in over_time.items()},
            coordinates=coordinates | {name: (("scenario",), column) for name, column in asked.items()},
            about={"model": str(self.model), "frame": self.frame},
        )

    def _long(self, over_time: dict[str, Array]) -> dict[str, Array]:
        times = np.broadcast_to(self.time_s, self.x_m.shape)
        own = np.isfinite(times) & (self.outcome != "")[:, None]
        scenario = np.broadcast_to(np.arange(len(self))[:, None], times.shape)
        return {"scenario": scenario[own], "time_s": times[own]} | {name: each[own] for name, each in over_time.items()}

    def _errors(self) -> dict[str, Words]:
        details = [""] * len(self)
        for failure in self.failures:
            details[failure.index] = failure.detail
        return {"error": np.array(details, dtype=np.str_)}

    def _said(self) -> str:
        words, counts = np.unique(self.outcome[self.outcome != ""], return_counts=True)
        told = [f"{count} {word}" for word, count in zip(words.tolist(), counts.tolist(), strict=True)]
        return ", ".join([*told, *([f"{len(self.failures)} refused"] if self.failures else [])])

    def _facts(self) -> Facts:
        answered = self.outcome != ""
        known = self.final_x_m[answered]
        rows = [
            ("outcomes", self._said()),
            ("final x", f"{known.min():.3f} to {known.max():.3f} m" if known.size else "none"),
            ("inside the domain", f"{np.count_nonzero(self.inside)} of {np.count_nonzero(answered)}"),
            *(("refused", failure.detail) for failure in self.failures[:_LISTED]),
            ("model", str(self.model)),
        ]
        times = np.broadcast_to(self.time_s, self.x_m.shape)
        shown = np.unique(np.linspace(0, len(self) - 1, min(len(self), 40)).astype(int))
        lines = tuple(Line(times[row], self.x_m[row]) for row in shown if answered[row])
        last = "" if not known.size else f"{np.nanmax(self.time_s):g}"
        return Facts(f"{len(self)} scenarios", tuple(rows), lines, caption=f"x (m) over {last} s")
