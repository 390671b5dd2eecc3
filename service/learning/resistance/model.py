"""The resistance process as a model: predicts whole trajectories by integrating the learned equation of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

from service.learning.resistance.engine import Engine
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.kernels import ScenarioFeatures
from service.learning.resistance.start import StartProcess
from service.learning.resistance.stored import TensorReader
from service.learning.resistance.tables import TRAVEL_KNOTS_M, ResponseTables
from service.learning.resistance.traction import TractionCurves
from service.learning.trajectory_model import motion_by_difference
from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios
from service.physics.similarity import torque_ratio


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
    _engine: Engine = field(init=False, repr=False)

    quick: ClassVar[bool] = True
    knows_wheel_speeds: ClassVar[bool] = False

    def __post_init__(self) -> None:
        parts = (getattr(self, each.name) for each in fields(self) if each.init)
        object.__setattr__(self, "_engine", Engine(*parts))

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions (m), shape (scenario, time), at `time_s` >= 0 of shape (time,) or (scenario, time).

        Raises ValueError for times that are not finite, and MemoryError for a horizon of more than 50 days.
        """
        ratio = torque_ratio(self.prior.rover, self.prior.regolith, scenarios)
        return Positions(*self._engine.predict(scenarios.slope_angle_rad, scenarios.mass_kg, ratio, time_s))

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        """The same positions with their speeds; the wheels' are not known."""
        return motion_by_difference(self.positions, scenarios, time_s)

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
