"""A small real model whose force balance can be wrong, and runs of it that are wrong by known offsets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from service.learning.observed import Controls, ObservedRun
from service.learning.trajectory_model import motion_by_difference
from service.physics.prior import Prior
from service.physics.priors import make_prior
from service.physics.scenario import Array, Motion, Positions, Scenarios
from service.physics.similarity import torque_ratio_of

HORIZON_S = 10.0
_STEP_S = 0.05
_LAG_S, _PUSH_M_S, _HOLD = 0.5, 3.0, 0.02


@dataclass(frozen=True)
class Pushed:
    """A rover that approaches the speed at which drive, slope and resistance balance; small pushes do not move it."""

    resistance: float = 0.1
    prior: Prior = field(default_factory=lambda: make_prior("motor_slope", 0.3))
    quick: ClassVar[bool] = True
    knows_wheel_speeds: ClassVar[bool] = False

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        return self.positions_with(scenarios, time_s, 0.0)

    def positions_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Positions:
        drive = self._drive(scenarios.mass_kg, scenarios.torque_nm)
        settled = self._settled(drive, scenarios.slope_angle_rad, offset)
        x = settled[:, None] * (time_s - _LAG_S * (1.0 - np.exp(-time_s / _LAG_S)))
        return Positions(x, np.full_like(x, 0.2))

    def ways_with(self, scenarios: Scenarios, time_s: Array, offset: Array | float) -> Array:
        return self.positions_with(scenarios, time_s, offset).x_m

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        return motion_by_difference(self.positions, scenarios, time_s)

    def drive_run(self, run: ObservedRun, offset: float = 0.0) -> Positions:
        if not run.varies:
            return self.positions_with(run.scenario, run.time_s, offset)
        settled = self._settled(self._drive(run.mass_kg, run.torques_nm), run.slope_angle_rad, offset)
        settled = np.where(run.brakes, 0.0, settled)
        speed, x = 0.0, np.zeros(len(run.time_s))
        for at, step in enumerate(np.diff(run.time_s)):
            speed += (settled[at] - speed) * (1.0 - np.exp(-step / _LAG_S))
            x[at + 1] = x[at] + speed * step
        return Positions(x[None], np.full((1, len(x)), 0.2))

    def _drive(self, mass_kg: Array | float, torque_nm: Array | float) -> Array:
        ratio = torque_ratio_of(self.prior.rover, self.prior.regolith, np.asarray(mass_kg), np.asarray(torque_nm))
        return np.asarray(0.8 * (1.0 - np.exp(-3.0 * ratio)))

    def _settled(self, drive: Array, slope_rad: Array, offset: Array | float) -> Array:
        push = drive - np.sin(slope_rad) - self.resistance - offset
        return np.asarray(_PUSH_M_S * np.sign(push) * np.maximum(np.abs(push) - _HOLD, 0.0))


MODEL = Pushed()


def made(scenario: Scenarios, offset: float, name: str, horizon_s: float = HORIZON_S) -> ObservedRun:
    """A run of a rover whose resistance is larger than the model has it, with ripples of some millimetres."""
    times = np.linspace(0.0, horizon_s, round(horizon_s / _STEP_S) + 1)
    x = MODEL.positions_with(scenario, times, offset).x_m[0] + 0.003 * np.sin(7.0 * times)
    return ObservedRun(name, "unit", scenario, times, x - x[0], 0.2 + 0.002 * np.sin(3.0 * times))


def made_drive(slope_deg: float, offset: float, name: str) -> ObservedRun:
    """It meets a slope that changes, a torque that changes, and brakes for a while."""
    times = np.linspace(0.0, 20.0, 401)
    slope = np.radians(slope_deg + 5.0 * np.sin(0.5 * times))
    torque = np.where(times > 8.0, 90.0, 60.0)
    brake = (times > 12.0) & (times < 14.0)
    scenario = Scenarios(slope[:1], np.array([430.0]), torque[:1])
    controls = Controls(slope, np.where(brake, 0.0, torque), brake)
    run = ObservedRun(name, "unit", scenario, times, 0.0 * times, 0.2 + 0.0 * times, controls=controls)
    return replace(run, x_m=MODEL.drive_run(run, offset).x_m[0])


def many(count: int, seed: int, spread: float = 0.004) -> list[ObservedRun]:
    """Runs over slopes, masses and torques, each fourth of them a drive; their offsets are drawn from a normal."""
    random = np.random.default_rng(seed)
    runs = []
    for at in range(count):
        slope, offset = float(random.uniform(0.0, 33.0)), float(random.normal(0.0, spread))
        mass, torque = float(random.uniform(300.0, 900.0)), float(random.uniform(40.0, 120.0))
        if at % 4 == 3:
            runs.append(made_drive(0.6 * slope, offset, f"drive{at}"))
        else:
            runs.append(made(Scenarios.of(slope, mass, torque), offset, f"run{at}"))
    return runs


def models(runs: Sequence[ObservedRun]) -> dict[str, Pushed]:
    """The model that left out each run: always the same, since nothing was learned."""
    return {run.name: MODEL for run in runs}
