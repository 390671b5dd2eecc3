"""The values that the service answers, as frozen dataclasses. Arrays are read-only, and numbers in them float64.

In the frame `slope`, x runs along the slope, positive uphill, and y is normal to it. In the frame `world`, x is
horizontal and z is up. So a trajectory has `y_m` in the slope frame and `z_m` in the world frame; the other is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rover_twin_client.shown import Facts, Line, Shown, Table, plots
from rover_twin_client.shown.facts import over_time, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Frame: TypeAlias = Literal["slope", "world"]
Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Words: TypeAlias = NDArray[np.str_]
SPEEDS = ("speed_m_s", "rear_wheel_speed_rad_s", "front_wheel_speed_rad_s")


@dataclass(frozen=True, slots=True)
class Scenario:
    """The scenario that the service predicted, with its defaults. The torque is the motor stall torque per wheel."""

    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float


@dataclass(frozen=True, slots=True)
class ModelIdentity:
    """The version that answered, and the alias that the caller asked for (None when it asked for a number)."""

    name: str
    version: int
    alias: str | None

    def __str__(self) -> str:
        return f"{self.name}@{self.version}"


@dataclass(frozen=True, slots=True)
class DomainReason:
    """One input that lies outside the validated region, with the bounds of the region in the unit of the input.

    The field `joint` stands for all inputs together. Its value is the scaled distance to the nearest training run.
    """

    field: str
    value: float
    lowest: float | None
    highest: float | None
    detail: str


@dataclass(frozen=True, slots=True)
class NearestRun:
    """A training run near the scenario, and its scaled distance to the scenario.

    `left_out_final_error_m` is the error of its final position when the model was trained without this run, or None
    when that was not measured.
    """

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    left_out_final_error_m: float | None
    distance: float


@dataclass(frozen=True, slots=True)
class Domain:
    """Whether the scenario lies inside the region where the model was validated; if not, `reasons` says why.

    `distance` is the distance to the nearest training run, scaled by the spread of the runs. For a version or a service
    that does not list its runs, `distance` is None and `nearest_runs` is empty.
    """

    inside: bool
    reasons: tuple[DomainReason, ...]
    distance: float | None = None
    nearest_runs: tuple[NearestRun, ...] = ()

    def __str__(self) -> str:
        return "inside" if self.inside else "outside: " + "; ".join(reason.detail for reason in self.reasons)


@dataclass(frozen=True, slots=True)
class Summary:
    """A summary of the trajectory, the same however it is sampled. `outcome` is climbs, stalls or slides.

    The final coordinates are always in the slope frame. `slip_ratio` is None when the wheels stand still, or when the
    model does not know how they turn.
    """

    outcome: str
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    slip_ratio: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The closed-form trajectory, without the learned correction, at the times of the prediction; arrays (N,)."""

    name: str
    x_m: Array
    y_m: Array | None
    z_m: Array | None

    def columns(self) -> dict[str, Array]:
        """The positions under the names that they have in a table."""
        positions = {"prior_x_m": self.x_m, "prior_y_m": self.y_m, "prior_z_m": self.z_m}
        return {name: column for name, column in positions.items() if column is not None}


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Lower and upper bounds of x and y in the slope frame, at the times of the prediction; arrays (N,), in metres.

    `level` is the pointwise coverage: for runs like the training runs, the true position lies inside at this share of
    all times.
    """

    level: float
    x_lower_m: Array
    x_upper_m: Array
    y_lower_m: Array
    y_upper_m: Array

    def columns(self) -> dict[str, Array]:
        """The bounds by name."""
        names = ("x_lower_m", "x_upper_m", "y_lower_m", "y_upper_m")
        return {name: getattr(self, name) for name in names}

    def around(self, name: str) -> tuple[Array, Array, float] | None:
        """Lower and upper bounds of x_m or y_m, and the level; None for what has none."""
        bounds = {"x_m": (self.x_lower_m, self.x_upper_m), "y_m": (self.y_lower_m, self.y_upper_m)}
        return (*bounds[name], self.level) if name in bounds else None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Prediction(Shown):
    """Where the rover goes: positions in metres at the times `time_s` in seconds; arrays (N,).

    The last time is the horizon. `prior` and `band` are None unless the call had `include=["prior", "band"]`. With
    `speed` and `wheel_speed` in it, `speed_m_s` is the speed along the slope in both frames, positive uphill, and the
    wheel speeds of both axles are in rad/s; arrays (N,), else None.
    """

    model: ModelIdentity
    scenario: Scenario
    frame: Frame
    time_s: Array
    x_m: Array
    y_m: Array | None
    z_m: Array | None
    prior: Prior | None
    domain: Domain
    summary: Summary
    band: Band | None = None
    speed_m_s: Array | None = None
    rear_wheel_speed_rad_s: Array | None = None
    front_wheel_speed_rad_s: Array | None = None

    def plot(self, column: str = "x_m", ax: Axes | None = None) -> Axes:
        """Plots one column of `to_pandas` over time, with band and prior where they were included (matplotlib).

        `ax` are the axes to draw on, by default those of a new figure. Returns the axes. Raises InvalidInputError for a
        column that this prediction does not have.
        """
        columns = self._table().columns
        prior = None if self.prior is None else self.prior.columns().get(f"prior_{column}")
        interval = None if self.band is None else self.band.around(column)
        title = f"{self.summary.outcome} - {_asked(self.scenario)}"
        values = plots.chosen(columns, column)
        return plots.over_time(ax, title, self.time_s, column, values, prior=prior, interval=interval)

    def _table(self) -> Table:
        positions = {"time_s": self.time_s, "x_m": self.x_m, "y_m": self.y_m, "z_m": self.z_m}
        speeds = {name: getattr(self, name) for name in SPEEDS}
        prior = {} if self.prior is None else self.prior.columns()
        band = {} if self.band is None else self.band.columns()
        scenario = {name: getattr(self.scenario, name) for name in ("slope_deg", "mass_kg", "torque_nm", "horizon_s")}
        about = {"model": str(self.model), "frame": self.frame, "outcome": self.summary.outcome, **scenario}
        return over_time({**positions, **speeds, **prior, **band}, about)

    def _facts(self) -> Facts:
        x = None if self.band is None else self.band.around("x_m")
        y = None if self.band is None else self.band.around("y_m")
        lower, upper, level = x or (None, None, None)
        rows = [
            ("outcome", self.summary.outcome),
            ("final x", span(self.summary.final_x_m, lower, upper, level)),
            ("final y", span(self.summary.final_y_m, *(y or (None, None, None)))),
            ("domain", str(self.domain)),
            ("model", str(self.model)),
        ]
        curve = Line(self.time_s, self.x_m, lower, upper)
        return Facts(_asked(self.scenario), tuple(rows), (curve,), caption=f"x (m) over {self.time_s[-1]:g} s")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MobilityMap(Shown):
    """Outcome, speed and slip of one mass. A table has a row for each torque (T) and a column for each slope (S).

    `outcome` is climbs, stalls or slides. `mean_speed_m_s` is the speed along the slope, negative downhill.
    `slip_ratio` is NaN when the wheels stand still, or when the model does not know how they turn.

    `steepest_climb_slope_deg` has one slope for each torque: the rover climbs every slope of the map up to this one. It
    is NaN when the rover does not even climb the lowest slope, or when no cell of the torque is inside the domain.
    `steepest_inside_domain` says for each torque whether that slope is itself inside; None where there is none.
    `steepest_by` says how this was judged: by the `band`, with `confidence`, or by the `central_estimate` of a version
    without a band (`confidence` is None).
    """

    model: ModelIdentity
    mass_kg: float
    horizon_s: float
    confidence: float | None
    steepest_by: str
    torque_nm: Array  # (T,)
    slope_deg: Array  # (S,)
    outcome: Words  # (T, S)
    mean_speed_m_s: Array  # (T, S)
    slip_ratio: Array  # (T, S)
    inside_domain: Flags  # (T, S)
    steepest_climb_slope_deg: Array  # (T,)
    steepest_inside_domain: tuple[bool | None, ...]  # (T,)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Plots the outcomes over slope and torque, with the steepest slope of each torque as a line (matplotlib).

        `ax` are the axes to draw on, by default those of a new figure. Returns the axes.
        """
        title = f"{self.mass_kg:g} kg, {self.horizon_s:g} s - {self.model}"
        names = ("slope_deg", "torque_nm")
        axes = plots.grid(ax, title, self.slope_deg, self.torque_nm, self.outcome, names)
        axes.plot(self.steepest_climb_slope_deg, self.torque_nm, color="black", marker="o", markersize=3)
        return axes

    def _table(self) -> Table:
        axes = ("torque_nm", "slope_deg")
        cells = {name: getattr(self, name) for name in ("outcome", "mean_speed_m_s", "slip_ratio", "inside_domain")}
        torque, slope = np.meshgrid(self.torque_nm, self.slope_deg, indexing="ij")
        long = {"torque_nm": torque.ravel(), "slope_deg": slope.ravel()}
        return Table(
            columns=long | {name: each.ravel() for name, each in cells.items()},
            variables={name: (axes, each) for name, each in cells.items()}
            | {"steepest_climb_slope_deg": (axes[:1], self.steepest_climb_slope_deg)},
            coordinates={"torque_nm": (axes[:1], self.torque_nm), "slope_deg": (axes[1:], self.slope_deg)},
            about={"model": str(self.model), "mass_kg": self.mass_kg, "horizon_s": self.horizon_s},
        )

    def _facts(self) -> Facts:
        words, counts = np.unique(self.outcome, return_counts=True)
        known = self.steepest_climb_slope_deg[np.isfinite(self.steepest_climb_slope_deg)]
        steepest = f"{known.max():.1f} deg" if known.size else "none"
        sure = "" if self.confidence is None else f", {self.confidence:.0%} sure"
        shape = f"{self.torque_nm.size} torques x {self.slope_deg.size} slopes"
        rows = [
            (
                "cells",
                ", ".join(f"{count} {word}" for word, count in zip(words.tolist(), counts.tolist(), strict=True)),
            ),
            ("steepest climb", steepest + sure),
            ("inside the domain", f"{np.count_nonzero(self.inside_domain)} of {self.inside_domain.size} cells"),
            ("model", str(self.model)),
        ]
        caption = (
            f"slope {self.slope_deg[0]:g} to {self.slope_deg[-1]:g} deg, "
            f"torque {self.torque_nm[0]:g} to {self.torque_nm[-1]:g} N m"
        )
        title = f"{self.mass_kg:g} kg, {shape}"
        return Facts(title, tuple(rows), grid=self.outcome, caption=caption, colours=plots.COLOURS)


@dataclass(frozen=True, slots=True)
class SuggestionReason:
    """Why a scenario is worth a simulation: the expected error of its final position, and the nearest training run.

    `expected_error_m` is None when no run of the version has a left-out error. `distance` is the distance to the
    nearest run, scaled by the spread of the runs.
    """

    expected_error_m: float | None
    distance: float
    nearest_run: str


@dataclass(frozen=True, slots=True)
class SuggestedRun:
    """A scenario to simulate, as a row of `runs.csv` in a dataset. Its file has one row every `step_s` seconds."""

    file: str
    set: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    step_s: float
    reason: SuggestionReason


@dataclass(frozen=True, slots=True)
class SuggestedRuns:
    """Scenarios whose simulation makes the next version better than `model`; the most useful one is first."""

    model: ModelIdentity
    runs: tuple[SuggestedRun, ...]


@dataclass(frozen=True, slots=True)
class ModelInfo:
    """A model: its versions that can be used, archived and deleted ones, rising; and the version of each alias."""

    name: str
    versions: tuple[int, ...]
    aliases: Mapping[str, int]
    description: str | None = None
    archived: tuple[int, ...] = ()
    deleted: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Readiness:
    """The service can predict. `model` is the version that answers by default, `failures` what it could not load.

    A service tells failures to clients with a token only.
    """

    model: ModelIdentity
    failures: tuple[object, ...]


def _asked(scenario: Scenario) -> str:
    return (
        f"slope {scenario.slope_deg:g} deg, {scenario.mass_kg:g} kg, "
        f"{scenario.torque_nm:g} N m, {scenario.horizon_s:g} s"
    )
