"""The resistance process as a model: predicts whole trajectories by integrating the learned equation of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from service.learning.resistance.features import mass_kg, scaled_features, slope_angle_rad, stall_gate
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.integrate import TRAVEL_GRID_M, integrate, steps_until
from service.learning.resistance.kernels import ScenarioFeatures, scenario_kernels
from service.learning.resistance.start import StartProcess, start_features
from service.learning.resistance.stored import TensorReader
from service.learning.resistance.tables import TRAVEL_KNOTS_M, ResponseTables
from service.learning.resistance.traction import SpeedLaw, TractionCurves, speed_law
from service.physics.prior import Prior
from service.physics.scenario import Array, Positions, Scenarios
from service.physics.similarity import torque_ratio


@dataclass(frozen=True, slots=True, eq=False)
class ResistanceProcess:
    """dv/dt = g [F(v, x) - sin th - rho(x, t)] with v(0) and rho from Gaussian processes, and y from one more.

    Implements `service.learning.model.TrajectoryModel`. The prior takes no part in the answer: it comes along as what
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

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions (m) at `time_s` >= 0 of shape (time,); the answer has shape (scenario, time)."""
        time = np.asarray(time_s, dtype=np.float64)
        x, y = np.empty((len(scenarios), len(time))), np.empty((len(scenarios), len(time)))
        if len(time):
            for row in range(len(scenarios)):
                one = Scenarios(
                    scenarios.slope_angle_rad[row : row + 1],
                    scenarios.mass_kg[row : row + 1],
                    scenarios.torque_nm[row : row + 1],
                )
                x[row], y[row] = self._trajectory(one, time)
        return Positions(x, y)

    def corrected(self, prior: Positions, scenarios: Scenarios, time_s: Array) -> Positions:  # noqa: ARG002
        """The model's own positions: x_corr = x_phys + (x_model - x_phys), so the prior's positions cancel."""
        return self.positions(scenarios, time_s)

    def _trajectory(self, scenario: Scenarios, time_s: Array) -> tuple[Array, Array]:
        mass = self._mass_kg(scenario)
        law, features = self._situation(scenario, mass)
        start = start_features(slope_angle_rad(features.scaled), features.scaled[:, 2])[0]
        start_speed, start_height = self.start.at(start)
        steps = steps_until(float(time_s.max()))
        kernels = scenario_kernels(self.hyper.resistance, features, self.features)
        scale = (mass / self.hyper.reference_mass_kg) ** self.hyper.mass_exponent
        along_travel = np.interp(TRAVEL_GRID_M, TRAVEL_KNOTS_M, self.resistance.along_travel(kernels))
        along_time = np.interp(steps.middle_s, self.time_knots_s, self.resistance.along_time(kernels))
        travel = integrate(
            self.hyper,
            law,
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

    def _mass_kg(self, scenario: Scenarios) -> float:
        """The mass for the laws of traction and resistance: these reach further than the features do."""
        known = mass_kg(self.features.scaled, self.hyper)
        reach = self.hyper.mass_reach
        return float(np.clip(scenario.mass_kg[0], known.min() / reach, known.max() * reach))

    def _situation(self, scenario: Scenarios, mass: float) -> tuple[SpeedLaw, ScenarioFeatures]:
        """The speed law of one scenario and its features, held to the training ranges."""
        rover, regolith, margin = self.prior.rover, self.prior.regolith, self.hyper.feature_margin
        known = self.features.scaled
        scaled = scaled_features(scenario, rover, regolith, self.hyper)
        scaled = np.clip(scaled, known.min(axis=0) - margin, known.max(axis=0) + margin)
        law = speed_law(
            rover,
            self.curves,
            self.hyper,
            float(scenario.slope_angle_rad[0]),
            float(torque_ratio(rover, regolith, scenario)[0]),
            mass,
        )
        return law, ScenarioFeatures(scaled, stall_gate(scaled, np.array([law.margin]), self.hyper))

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


def _read_tables(read: TensorReader, name: str, runs: int, knots: int) -> ResponseTables:
    return ResponseTables(
        read.take(f"{name}.level", (runs,)),
        read.take(f"{name}.rut", (runs,)),
        read.take(f"{name}.travel", (runs, len(TRAVEL_KNOTS_M))),
        read.take(f"{name}.release", (runs, knots)),
        read.take(f"{name}.stall", (runs, knots)),
    )
