"""What learning sees of a simulation: its scenario, what changed underway, and where the wheel was at each time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.errors import TrainingError
from service.physics.scenario import Array, Scenarios


@dataclass(frozen=True, slots=True, eq=False)
class Controls:
    """What acted on the rover at each row, (time,); None for what did not change: the scenario says that.

    `slope_angle_rad` is the slope under the rover's middle, `torque_nm` the stall torque of each wheel's motor (0:
    motors off, wheels free), `brake` is True where motors are off and wheels locked (None: never).
    """

    slope_angle_rad: Array | None = None
    torque_nm: Array | None = None
    brake: npt.NDArray[np.bool_] | None = None

    def __bool__(self) -> bool:
        return any(column is not None for column in (self.slope_angle_rad, self.torque_nm, self.brake))

    def samples(self, selection: slice | npt.NDArray[np.intp]) -> Controls:
        """Only the selected rows."""
        return Controls(
            _selected(self.slope_angle_rad, selection),
            _selected(self.torque_nm, selection),
            None if self.brake is None else self.brake[selection],
        )


@dataclass(frozen=True, slots=True, eq=False)
class ObservedRun:
    """One run: `scenario` holds exactly one scenario; `time_s`, `x_m`, `y_m` have shape (time,).

    `mean_wheel_speed_rad_s` is the spin of the wheels averaged over the run, `rear_wheel_speed_rad_s` and
    `front_wheel_speed_rad_s` (time,) that of each axle, `body_speed_m_s` (time,) how fast the rover's body moves along
    the slope, where the simulation recorded them.
    Where slope, torque or brake change underway, `controls` has them, and `scenario` holds slope and torque at the
    start.
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
    controls: Controls = Controls()

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
        for control in (self.controls.slope_angle_rad, self.controls.torque_nm, self.controls.brake):
            if control is not None and (len(control) != len(self.time_s) or not np.isfinite(control).all()):
                raise ValueError(f"run {self.name}: controls must be finite and as many as time_s")

    @property
    def varies(self) -> bool:
        """Whether slope, torque or brake change underway."""
        return bool(self.controls)

    @property
    def slope_angle_rad(self) -> Array:
        """Slope at each row (time,), rad, whether it changes or not."""
        changing = self.controls.slope_angle_rad
        return np.full(len(self.time_s), self.scenario.slope_angle_rad[0]) if changing is None else changing

    @property
    def torques_nm(self) -> Array:
        """Stall torque of each wheel's motor at each row (time,), N m, whether it changes or not."""
        return np.full(len(self.time_s), self.torque_nm) if self.controls.torque_nm is None else self.controls.torque_nm

    @property
    def brakes(self) -> npt.NDArray[np.bool_]:
        """Whether the wheels are locked, at each row (time,)."""
        return np.zeros(len(self.time_s), dtype=np.bool_) if self.controls.brake is None else self.controls.brake

    @property
    def horizon_s(self) -> float:
        """Last time of the run, s."""
        return float(self.time_s[-1])

    @property
    def slope_deg(self) -> float:
        """Slope angle in degrees (at the start, where it changes), rounded to what run tables state."""
        return round(float(np.degrees(self.scenario.slope_angle_rad[0])), 6)

    @property
    def mass_kg(self) -> float:
        """Mass of the whole rover, kg."""
        return float(self.scenario.mass_kg[0])

    @property
    def torque_nm(self) -> float:
        """Motor stall torque per wheel, N m (at the start, where it changes)."""
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
            self.controls.samples(selection),
        )


def _selected(column: Array | None, selection: slice | npt.NDArray[np.intp]) -> Array | None:
    return None if column is None else column[selection]


def scenarios_of(runs: Sequence[ObservedRun]) -> Scenarios:
    """The scenarios of the runs, in order; shape (run,)."""
    return Scenarios.stack(run.scenario for run in runs)


def require_constant(runs: Sequence[ObservedRun]) -> None:
    """Raises TrainingError naming the first runs whose slope, torque or brake change underway.

    What takes a run for one scenario calls this: it would read such a run as one under slope and torque of its start.
    """
    varying = [run.name for run in runs if run.varies]
    if varying:
        more = f" and {len(varying) - 3} more" if len(varying) > 3 else ""
        raise TrainingError(
            f"slope, torque or brake change within {', '.join(varying[:3])}{more}: this model takes only runs in which "
            "they are constant; name datasets without such runs"
        )
