"""What learning sees of a simulation: one scenario and where the wheel was at each time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array, Scenarios


@dataclass(frozen=True, slots=True, eq=False)
class ObservedRun:
    """One run: `scenario` holds exactly one scenario; `time_s`, `x_m`, `y_m` have shape (time,).

    `mean_wheel_speed_rad_s` is the spin of the wheels averaged over the run, `rear_wheel_speed_rad_s` and
    `front_wheel_speed_rad_s` (time,) that of each axle, `body_speed_m_s` (time,) how fast the rover's body moves along
    the slope, where the simulation recorded them.
    Raises ValueError for columns of different lengths, fewer than two rows or values that are not finite.
    """

    name: str
    set_name: str
    scenario: Scenarios
    time_s: Array
    x_m: Array
    y_m: Array
    mean_wheel_speed_rad_s: float | None = None
    rear_wheel_speed_rad_s: Array | None = None
    front_wheel_speed_rad_s: Array | None = None
    body_speed_m_s: Array | None = None

    def __post_init__(self) -> None:
        if len(self.scenario) != 1:
            raise ValueError(f"run {self.name} must have one scenario, got {len(self.scenario)}")
        if not (len(self.time_s) == len(self.x_m) == len(self.y_m) >= 2):
            raise ValueError(f"run {self.name}: time_s, x_m and y_m must have the same length, at least 2")
        if not (np.isfinite(self.time_s).all() and np.isfinite(self.x_m).all() and np.isfinite(self.y_m).all()):
            raise ValueError(f"run {self.name} has values that are not finite")
        for speed in (self.rear_wheel_speed_rad_s, self.front_wheel_speed_rad_s, self.body_speed_m_s):
            if speed is not None and (len(speed) != len(self.time_s) or not np.isfinite(speed).all()):
                raise ValueError(f"run {self.name}: recorded speeds must be finite and as many as time_s")

    @property
    def horizon_s(self) -> float:
        """Last time of the run, s."""
        return float(self.time_s[-1])

    @property
    def slope_deg(self) -> float:
        """Slope angle in degrees, rounded to what run tables state."""
        return round(float(np.degrees(self.scenario.slope_angle_rad[0])), 6)

    @property
    def mass_kg(self) -> float:
        """Mass of the whole rover, kg."""
        return float(self.scenario.mass_kg[0])

    @property
    def torque_nm(self) -> float:
        """Motor stall torque per wheel, N m."""
        return float(self.scenario.torque_nm[0])

    def samples(self, selection: slice | npt.NDArray[np.intp]) -> ObservedRun:
        """The same run with only the selected samples."""
        return ObservedRun(
            self.name,
            self.set_name,
            self.scenario,
            self.time_s[selection],
            self.x_m[selection],
            self.y_m[selection],
            self.mean_wheel_speed_rad_s,
            _selected(self.rear_wheel_speed_rad_s, selection),
            _selected(self.front_wheel_speed_rad_s, selection),
            _selected(self.body_speed_m_s, selection),
        )


def _selected(column: Array | None, selection: slice | npt.NDArray[np.intp]) -> Array | None:
    return None if column is None else column[selection]


def scenarios_of(runs: Sequence[ObservedRun]) -> Scenarios:
    """The scenarios of the runs, in order; shape (run,)."""
    return Scenarios.stack(run.scenario for run in runs)
