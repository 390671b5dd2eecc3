"""The drive model: a law and its start speeds, answering constant scenarios, whole tracks and steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from service.learning.drive.engine import Engine
from service.learning.drive.inputs import Controls, Track
from service.learning.drive.law import PARAMETERS, Basis, Law
from service.learning.drive.library import HEIGHTS
from service.learning.drive.recorded import controls_of, track_of
from service.learning.drive.start import StartSpeeds, bump_count
from service.learning.drive.state import State
from service.learning.drive.timetable import Account, Timetable
from service.learning.drive.whole import Whole
from service.learning.observed import ObservedRun
from service.learning.tensor_reader import TensorReader
from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios


@dataclass(frozen=True, slots=True, eq=False)
class DriveModel:
    """dv/dt = g [F(v, state) - sin(slope) - rho(v, state)], integrated; y from the state.

    Implements `trajectory_model.TrajectoryModel`: a constant slope from rest is a drive like any other. The prior takes
    no part in the answer: it comes along as what others compare with, and it holds rover and regolith. Immutable, safe
    to share by threads.
    """

    prior: Prior
    law: Law
    starts: StartSpeeds
    engine: Engine = field(init=False, repr=False)

    quick: ClassVar[bool] = True
    knows_wheel_speeds: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "engine", Engine(self.law))

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions (m), shape (scenario, time), at `time_s` >= 0 of shape (time,) or (scenario, time).

        Raises ValueError for times that are not finite or negative.
        """
        return self.positions_with(scenarios, time_s, 0.0)

    def positions_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Positions:
        """The same where the resistance is larger by `offset`, a fraction of the weight, (scenario,) or one for all."""
        slopes, masses = scenarios.slope_angle_rad, scenarios.mass_kg
        starts = self.starts.at(slopes, masses)
        return Positions(*self.engine.places(slopes, masses, scenarios.torque_nm, starts, time_s, offset))

    def ways_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Array:
        """The x (m) of `positions_with` alone, (scenario, time), to the bit."""
        starts = self.starts.at(scenarios.slope_angle_rad, scenarios.mass_kg)
        return self.engine.ways(
            scenarios.slope_angle_rad, scenarios.mass_kg, scenarios.torque_nm, starts, time_s, offset
        )

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        """The same with the speed along the slope and how fast the wheels of each axle turn."""
        slopes, masses = scenarios.slope_angle_rad, scenarios.mass_kg
        starts = self.starts.at(slopes, masses)
        x, speed, front, rear, y = self.engine.constant(slopes, masses, scenarios.torque_nm, starts, time_s)
        return Motion(x, y, speed, rear, front)

    def whole_motion(
        self, scenarios: Scenarios, time_s: Array, horizon_s: Array, look_s: Array, *, moving: bool
    ) -> tuple[Positions, Whole]:
        """At times that do not fall, `motion`, or `positions` of those that are not `moving`, and what each way comes
        to until its horizon (scenario,).
        """
        slopes, masses = scenarios.slope_angle_rad, scenarios.mass_kg
        starts = self.starts.at(slopes, masses)
        columns, whole = self.engine.whole(
            slopes, masses, scenarios.torque_nm, starts, time_s, horizon_s, look_s, moving=moving
        )
        if not moving:
            return Positions(*columns), whole
        x, speed, front, rear, y = columns
        return Motion(x, y, speed, rear, front), whole

    def whole_ways(self, scenarios: Scenarios, horizon_s: Array, look_s: Array) -> Whole:
        """What `whole_motion` says of each way, but for heights and lengths of paths."""
        slopes, masses = scenarios.slope_angle_rad, scenarios.mass_kg
        starts = self.starts.at(slopes, masses)
        return self.engine.whole_ways(slopes, masses, scenarios.torque_nm, starts, horizon_s, look_s)

    def scenario(
        self, slope_rad: float, mass_kg: float, torque_nm: float, table: Timetable, columns: int
    ) -> tuple[Array, Account]:
        """One scenario, as `motion` has it, in a fraction of its time, and what the whole way comes to.

        Rows (columns, time) at the times that the table shows: x and y; of 5 also speed, front and rear wheel speed.
        Of numbers that a scenario can have.
        """
        return self.engine.scenario(self.starts.address, table, slope_rad, mass_kg, torque_nm, columns)

    def start(self, mass_kg: float, slope_rad: float, start_speed_m_s: float | None = None) -> State:
        """A rover at the start of a drive; without a speed it is parked and let go, as in the simulations."""
        speed = float(self.starts.at(np.array([slope_rad]), np.array([mass_kg]))[0])
        return self.engine.start(mass_kg, speed if start_speed_m_s is None else start_speed_m_s)

    def drive(
        self, start: State, track: Track, controls: Controls, time_s: Array, offset: float = 0.0
    ) -> tuple[Positions, State]:
        """Positions (1, time) along a track under controls, and the state at the last time; see `Engine.drive`."""
        motion, state = self.engine.drive(start, track, controls, time_s, offset)
        return Positions(motion.x_m[None], motion.y_m[None]), state

    def drive_run(self, run: ObservedRun, offset: float = 0.0) -> Positions:
        """What the model says of a recorded run, (1, time) at its times: its track, controls and mass are given."""
        rover = self.prior.rover
        if not run.varies:
            return self.positions_with(run.scenario, run.time_s, offset)
        start = self.start(run.mass_kg, float(run.slope_angle_rad[0]))
        return self.drive(start, track_of(run, rover), controls_of(run), run.time_s, offset)[0]

    def describe(self) -> dict[str, Any]:
        """Everything but the tensors and the prior, as JSON values."""
        return {
            "parameters": self.law.named,
            "motion_lengths": [float(each) for each in self.law.motion.lengths],
            "stall_lengths": [float(each) for each in self.law.stall.lengths],
            "start": {"slope_rad": list(self.starts.slope_rad), "mass_kg": list(self.starts.mass_kg)},
        }

    def tensors(self) -> dict[str, Array]:
        """The arrays, float64: together with `describe` and the prior what `restore` needs."""
        return {
            "motion.centres": self.law.motion.centres,
            "stall.centres": self.law.stall.centres,
            "weights": self.law.weights,
            "heights": self.law.heights,
            "reach": self.law.reach,
            "start.weights": self.starts.weights,
        }

    @classmethod
    def restore(cls, description: Mapping[str, Any], tensors: Mapping[str, Array], prior: Prior) -> DriveModel:
        """Inverse of `describe` and `tensors`. Raises ValueError for what does not fit, is missing or is not finite."""
        read = TensorReader(tensors)
        bumps, stall = read.length("motion.centres"), read.length("stall.centres")
        try:
            named = {str(name): float(value) for name, value in description["parameters"].items()}
            lengths = [
                np.array([float(each) for each in description[f"{kind}_lengths"]]) for kind in ("motion", "stall")
            ]
            slope, mass = (
                (float(low), float(high)) for low, high in (description["start"][n] for n in ("slope_rad", "mass_kg"))
            )
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"the description of the drive model does not fit: {error!r}") from error
        if set(named) != set(PARAMETERS):
            raise ValueError(f"not the parameters of this program: {sorted(set(named) ^ set(PARAMETERS))[:5]}")
        law = Law(
            prior.rover,
            prior.regolith,
            np.array([named[name] for name in PARAMETERS]),
            Basis(read.take("motion.centres", (bumps, 3)), lengths[0]),
            Basis(read.take("stall.centres", (stall, 3)), lengths[1]),
            read.take("weights", (2 * bumps + stall,)),
            heights=read.take("heights", (HEIGHTS,)),
            reach=read.take("reach", (3, 2)),
        )
        starts = StartSpeeds(read.take("start.weights", (bump_count(),)), slope, mass)
        read.require_nothing_left()
        return cls(prior, law, starts)
