"""The resistance process as a model: predicts whole trajectories by integrating the learned equation of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from service.learning.curves import interpolate_curves
from service.learning.resistance.features import mass_kg, scaled_features, slope_angle_rad, stall_gate
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.integrate import TRAVEL_GRID_M, Steps, integrate, steps_until
from service.learning.resistance.integrate_many import integrate_many
from service.learning.resistance.kernels import ScenarioFeatures, scenario_kernels
from service.learning.resistance.start import StartProcess, start_features
from service.learning.resistance.stored import TensorReader
from service.learning.resistance.tables import GRID_KNOTS, TRAVEL_CELLS, TRAVEL_KNOTS_M, ResponseTables
from service.learning.resistance.traction import SpeedLaws, TractionCurves, speed_laws
from service.physics.prior import Prior
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.similarity import torque_ratio

# Below so many scenarios, one after the other in plain numbers is faster than arrays over them.
_FEW = 16
# What a chunk of scenarios may take: about 50 MB of float64, of which a scenario needs so many for its tables and for
# each step.
_MOST_ROWS, _NUMBERS_AT_ONCE = 1024, 6_000_000
_NUMBERS_PER_ROW, _NUMBERS_PER_STEP = 3_500, 8


@dataclass(frozen=True, slots=True, eq=False)
class ResistanceProcess:
    """dv/dt = g [F(v, x) - sin th - rho(x, t)] with v(0) and rho from Gaussian processes, and y from one more.

    Implements `trajectory_model.TrajectoryModel`. The prior takes no part in the answer: it comes along as what
    others compare with, and it holds rover and regolith. Outside the training ranges (plus a margin) the scenario's
    features are held; its slope, weight and torque still act in the equation. Immutable, safe to share by threads.
    """

    prior: Prior
    hyper: Hyperparameters
    curves: TractionCurves
    features: ScenarioFeatures
    time_knots_s: Array
    resistance: ResponseTables
    height: ResponseTables
    start: StartProcess

    quick: ClassVar[bool] = True

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions (m), shape (scenario, time), at `time_s` >= 0 of shape (time,) or (scenario, time)."""
        time = np.asarray(time_s, dtype=np.float64)
        x, y = np.empty((2, len(scenarios), time.shape[-1]))
        if x.size and len(scenarios) < _FEW:
            for row in range(len(scenarios)):
                x[row], y[row] = self._trajectory(
                    _some(scenarios, slice(row, row + 1)), time if time.ndim == 1 else time[row]
                )
        elif x.size:
            # like horizons together: all of a chunk are integrated up to its longest
            last = np.broadcast_to(time.max(axis=-1), len(scenarios))
            rest = np.argsort(last, kind="stable")[::-1]
            while len(rest):
                steps = steps_until(float(last[rest[0]]))
                here, rest = np.split(rest, [_rows_at_once(len(steps.time_s))])
                some = time if time.ndim == 1 else time[here]
                x[here], y[here] = self._trajectories(_some(scenarios, here), some, steps)
        return Positions(x, y)

    def corrected(self, prior: Positions, scenarios: Scenarios, time_s: Array) -> Positions:  # noqa: ARG002
        """The model's own positions: x_corr = x_phys + (x_model - x_phys), so the prior's positions cancel."""
        return self.positions(scenarios, time_s)

    def _trajectory(self, scenario: Scenarios, time_s: Array) -> tuple[Array, Array]:
        """x and y of one scenario, each of shape (time,)."""
        mass = self._mass_kg(scenario)
        laws, features = self._situations(scenario, mass)
        start = start_features(slope_angle_rad(features.scaled), features.scaled[:, 2])[0]
        start_speed, start_height = self.start.at(start)
        steps = steps_until(float(time_s.max()))
        kernels = scenario_kernels(self.hyper.resistance, features, self.features)
        scale = (float(mass[0]) / self.hyper.reference_mass_kg) ** self.hyper.mass_exponent
        along_travel = np.interp(TRAVEL_GRID_M, TRAVEL_KNOTS_M, self.resistance.along_travel(kernels))
        along_time = np.interp(steps.middle_s, self.time_knots_s, self.resistance.along_time(kernels))
        travel = integrate(
            self.hyper,
            laws.one(0),
            self.prior.regolith.gravity_m_s2,
            scale * (self.hyper.mean_resistance + along_travel),
            scale * along_time,
            start_speed,
            steps,
        )
        kernels = scenario_kernels(self.hyper.height, features, self.features)
        height = start_height + np.interp(travel, TRAVEL_KNOTS_M, self.height.along_travel(kernels))
        height += np.interp(steps.time_s, self.time_knots_s, self.height.along_time(kernels))
        height[0] = start_height
        return np.interp(time_s, steps.time_s, travel), np.interp(time_s, steps.time_s, height)

    def _trajectories(self, scenarios: Scenarios, time_s: Array, steps: Steps) -> tuple[Array, Array]:
        """`_trajectory` of many: x and y of shape (scenario, time), for times (time,) or (scenario, time)."""
        mass = self._mass_kg(scenarios)
        laws, features = self._situations(scenarios, mass, whole=False)
        start = start_features(slope_angle_rad(features.scaled), features.scaled[:, 2])
        start_speed, start_height = self.start.at_many(start)
        kernels = scenario_kernels(self.hyper.resistance, features, self.features)
        scale = ((mass / self.hyper.reference_mass_kg) ** self.hyper.mass_exponent)[:, None]
        along_travel = self.resistance.over_travel(kernels, GRID_KNOTS)
        along_travel += self.hyper.mean_resistance
        along_travel *= scale
        along_time = self.resistance.over_time(steps.middle_s, self.time_knots_s, kernels)
        along_time *= scale

        def integrated(laws: SpeedLaws, rows: npt.NDArray[np.intp] | slice) -> tuple[Array, npt.NDArray[np.intp]]:
            gravity, start = self.prior.regolith.gravity_m_s2, start_speed[rows]
            return integrate_many(self.hyper, laws, gravity, along_travel[rows], along_time[rows], start, steps)

        travel, left = integrated(laws, slice(None))
        if len(left):
            travel[left], _ = integrated(self._situations(_some(scenarios, left), mass[left])[0], left)
        kernels = scenario_kernels(self.hyper.height, features, self.features)
        height = self.height.over_time(steps.time_s, self.time_knots_s, kernels)
        height += TRAVEL_CELLS.read(travel, self.height.over_travel(kernels))
        height += start_height[:, None]
        height[:, 0] = start_height
        return interpolate_curves(time_s, steps.time_s, travel), interpolate_curves(time_s, steps.time_s, height)

    def _mass_kg(self, scenarios: Scenarios) -> Array:
        """The masses for the laws of traction and resistance: these reach further than the features do."""
        known = mass_kg(self.features.scaled, self.hyper)
        reach = self.hyper.mass_reach
        return np.clip(scenarios.mass_kg, known.min() / reach, known.max() * reach)

    def _situations(
        self, scenarios: Scenarios, mass: Array, *, whole: bool = True
    ) -> tuple[SpeedLaws, ScenarioFeatures]:
        """The speed laws of scenarios (see `speed_laws`) and their features, held to the training ranges."""
        rover, regolith, margin = self.prior.rover, self.prior.regolith, self.hyper.feature_margin
        known = self.features.scaled
        scaled = scaled_features(scenarios, rover, regolith, self.hyper)
        scaled = np.clip(scaled, known.min(axis=0) - margin, known.max(axis=0) + margin)
        ratio = torque_ratio(rover, regolith, scenarios)
        laws = speed_laws(rover, self.curves, self.hyper, scenarios.slope_angle_rad, ratio, mass, whole=whole)
        return laws, ScenarioFeatures(scaled, stall_gate(scaled, laws.margin, self.hyper))

    def describe(self) -> dict[str, Any]:
        """Everything but the tensors and the prior, as JSON values."""
        return {"hyperparameters": self.hyper.describe(), "traction": self.curves.describe()}

    def tensors(self) -> dict[str, Array]:
        """The tables, float64: together with `describe` and the prior what `restore` needs."""
        tensors = {
            "features": self.features.scaled,
            "gate": self.features.gate,
            "travel_knots_m": TRAVEL_KNOTS_M,
            "time_knots_s": self.time_knots_s,
            "start.features": self.start.features,
            "start.weights": self.start.weights,
            "start.mean": self.start.mean,
        }
        for name, tables in (("resistance", self.resistance), ("height", self.height)):
            for part in ("level", "rut", "travel", "release", "stall"):
                tensors[f"{name}.{part}"] = getattr(tables, part)
        return tensors

    @classmethod
    def restore(cls, description: Mapping[str, Any], tensors: Mapping[str, Array], prior: Prior) -> ResistanceProcess:
        """Inverse of `describe` and `tensors`. Raises ValueError for what does not fit, is missing or is not finite."""
        try:
            hyper = Hyperparameters.restore(description["hyperparameters"])
            curves = TractionCurves.restore(description["traction"])
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"the description of the resistance process does not fit: {error!r}") from error
        read = TensorReader(tensors)
        runs, knots = read.length("features"), read.length("time_knots_s")
        if not np.array_equal(read.take("travel_knots_m", (len(TRAVEL_KNOTS_M),)), TRAVEL_KNOTS_M):
            raise ValueError("travel_knots_m are not the knots that this program interpolates between")
        features = ScenarioFeatures(read.take("features", (runs, 3)), read.take("gate", (runs,)))
        time_knots = read.take("time_knots_s", (knots,))
        if (np.diff(time_knots) <= 0).any():
            raise ValueError("time_knots_s must rise")
        resistance, height = (_read_tables(read, name, runs, knots) for name in ("resistance", "height"))
        start = StartProcess(
            read.take("start.features", (runs, 2)), read.take("start.weights", (runs, 2)), read.take("start.mean", (2,))
        )
        read.require_nothing_left()
        return cls(prior, hyper, curves, features, time_knots, resistance, height, start)


def _some(scenarios: Scenarios, rows: slice | npt.NDArray[np.intp]) -> Scenarios:
    return Scenarios(scenarios.slope_angle_rad[rows], scenarios.mass_kg[rows], scenarios.torque_nm[rows])


def _rows_at_once(steps: int) -> int:
    return max(_FEW, min(_MOST_ROWS, _NUMBERS_AT_ONCE // (_NUMBERS_PER_ROW + _NUMBERS_PER_STEP * steps)))


def _read_tables(read: TensorReader, name: str, runs: int, knots: int) -> ResponseTables:
    return ResponseTables(
        read.take(f"{name}.level", (runs,)),
        read.take(f"{name}.rut", (runs,)),
        read.take(f"{name}.travel", (runs, len(TRAVEL_KNOTS_M))),
        read.take(f"{name}.release", (runs, knots)),
        read.take(f"{name}.stall", (runs, knots)),
    )
