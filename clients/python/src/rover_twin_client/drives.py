"""The values of drives: tracks and controls that change, steps, and what the service answers. Arrays are read-only.

Distance is that of the rear wheel's centre along the track, in metres, zero where the rover starts. The slope that acts
is the one under the rover's middle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from rover_twin_client.answers import Array, Band, DomainReason, Flags, Frame, ModelIdentity
from rover_twin_client.errors import FieldFault
from rover_twin_client.shown import Facts, Line, Shown, Table, plots
from rover_twin_client.shown.facts import over_time, span

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Track: TypeAlias = Mapping[str, Sequence[float] | Array]
"""`{"distance_m": [...], "slope_deg": [...]}` or `{"horizontal_m": [...], "elevation_m": [...]}`."""
Controls: TypeAlias = float | Mapping[str, Sequence[float] | Sequence[bool] | Array | Flags]
"""A stall torque per wheel (N m), or `{"time_s": [...], "torque_nm": [...], "brake": [...]}`, each until the next."""
Transport: TypeAlias = Literal["websocket", "http"]


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """What happens at a time and place: `sticks`, `slides`, `goes_on`, `passes` (the last knot) or `arrives`."""

    event: str
    time_s: float
    x_m: float


@dataclass(frozen=True, slots=True)
class DriveSummary:
    """A summary of the drive, the same however it is sampled. `outcome` is passes, sticks or slides.

    `probabilities` are those of the three outcomes, None for a version that does not know its errors. The arrival is at
    `until_distance_m`, and with the probability of the band's level not before `arrival_earliest_s` nor after
    `arrival_latest_s`. Each is None when it lies beyond the horizon, and when no distance was asked for.
    """

    outcome: str
    probabilities: Mapping[str, float] | None
    arrival_time_s: float | None
    arrival_earliest_s: float | None
    arrival_latest_s: float | None
    motor_energy_j: float
    steepest_slope_deg: float
    steepest_at_m: float
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class Stretch:
    """A piece of the drive that lies inside the domain, or outside for `reasons`."""

    from_m: float
    to_m: float
    from_s: float
    to_s: float
    inside: bool
    reasons: tuple[DomainReason, ...]


@dataclass(frozen=True, slots=True)
class DriveDomain:
    """Whether the whole drive lies inside the region where the model was validated, and which stretches do."""

    inside: bool
    stretches: tuple[Stretch, ...]

    def __str__(self) -> str:
        if self.inside:
            return "inside"
        outside = [each for each in self.stretches if not each.inside]
        details = dict.fromkeys(reason.detail for each in outside for reason in each.reasons)
        return f"outside on {len(outside)} of {len(self.stretches)} stretches: " + "; ".join(details)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Drive(Shown):
    """Where the rover goes along its track; arrays (N,) at the times `time_s`.

    `slope_deg`, `torque_nm` and `brake` are what acts at each time. `y_m` is None in the frame `world`, `z_m` in the
    frame `slope`. `band` and the wheel speeds are None unless they were included.
    """

    model: ModelIdentity
    frame: Frame
    time_s: Array
    x_m: Array
    y_m: Array | None
    z_m: Array | None
    speed_m_s: Array
    slope_deg: Array
    torque_nm: Array
    brake: Flags
    slip_ratio: Array
    rear_wheel_speed_rad_s: Array | None
    front_wheel_speed_rad_s: Array | None
    band: Band | None
    events: tuple[DriveEvent, ...]
    summary: DriveSummary
    domain: DriveDomain

    def plot(self, column: str = "x_m", ax: Axes | None = None) -> Axes:
        """Plots one column of `to_pandas` over time, with its band and the events (matplotlib).

        `ax` are the axes to draw on, by default those of a new figure. Returns the axes.
        """
        values = plots.chosen(self._table().columns, column)
        interval = None if self.band is None else self.band.around(column)
        title = f"{self.summary.outcome} - {self._driven()}"
        axes = plots.over_time(ax, title, self.time_s, column, values, interval=interval)
        for event in self.events:
            axes.axvline(event.time_s, color="grey", linewidth=0.8, linestyle=":")
            axes.annotate(
                event.event, (event.time_s, 0.02), xycoords=("data", "axes fraction"), rotation=90, fontsize=8
            )
        return axes

    def _driven(self) -> str:
        return f"{self.summary.distance_m:.2f} m in {self.summary.duration_s:.4g} s"

    def _table(self) -> Table:
        names = ("time_s", "x_m", "y_m", "z_m", "speed_m_s", "slope_deg", "torque_nm", "brake", "slip_ratio")
        wheels = ("rear_wheel_speed_rad_s", "front_wheel_speed_rad_s")
        band = {} if self.band is None else self.band.columns()
        about = {"model": str(self.model), "frame": self.frame, "outcome": self.summary.outcome}
        return over_time({name: getattr(self, name) for name in (*names, *wheels)} | band, about)

    def _facts(self) -> Facts:
        x = None if self.band is None else self.band.around("x_m")
        lower, upper, level = x or (None, None, None)
        arrival = self.summary.arrival_time_s
        energy_j = self.summary.motor_energy_j
        rows = [
            ("outcome", self.summary.outcome),
            *([("arrives", f"after {arrival:.2f} s")] if arrival is not None else []),
            ("final x", span(self.summary.final_x_m, lower, upper, level)),
            ("motor energy", f"{energy_j:.3g} J" if np.isfinite(energy_j) else "unknown"),
            ("events", ", ".join(f"{each.event} at {each.time_s:.2f} s" for each in self.events) or "none"),
            ("domain", str(self.domain)),
            ("model", str(self.model)),
        ]
        curve = Line(self.time_s, self.x_m, lower, upper)
        return Facts(self._driven(), tuple(rows), (curve,), caption=f"x (m) over {self.time_s[-1]:.4g} s")


@dataclass(frozen=True, slots=True)
class FailedDrive:
    """One drive of a batch that was refused: its place among those sent, and what is wrong with it."""

    index: int
    detail: str
    faults: tuple[FieldFault, ...]


@dataclass(frozen=True, slots=True)
class Moment:
    """A rover after a step. `state` carries everything that its future depends on; it is None unless asked for.

    `x_half_width_m` is half the width of the 90 % interval of `x_m`, None where the version has no doubt. `inside` says
    whether the model was validated here, `reasons` why not.
    """

    id: str
    state: str | None
    time_s: float
    x_m: float
    y_m: float
    speed_m_s: float
    rear_wheel_speed_rad_s: float
    front_wheel_speed_rad_s: float
    slip_ratio: float
    x_half_width_m: float | None
    moving: bool
    inside: bool
    reasons: tuple[str, ...]
