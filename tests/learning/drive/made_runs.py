"""Runs that the engine itself makes: what acts on them and what comes of it are known."""

from __future__ import annotations

import numpy as np

from service.learning.drive.engine import Engine
from service.learning.drive.inputs import Controls, Track
from service.learning.observed import Controls as ObservedControls
from service.learning.observed import ObservedRun
from service.physics.scenario import Array, Scenarios


def made_run(
    engine: Engine, name: str, track: Track, controls: Controls, *, mass_kg: float, horizon_s: float, start: float = 0.0
) -> ObservedRun:
    """A run of that drive, every 5 ms."""
    time = np.arange(0.0, horizon_s + 1e-9, 0.005)
    motion, _ = engine.drive(engine.start(mass_kg, start), track, controls, time)
    slope = np.interp(motion.x_m + 0.5 * engine.law.rover.wheelbase_m, track.distance_m, track.slope_rad)
    at = np.searchsorted(controls.time_s, time, side="right") - 1
    brake = np.asarray(controls.brake)[at] > 0
    torque = controls.torque_nm[at]
    return ObservedRun(
        name,
        "made",
        Scenarios.of(float(np.degrees(slope[0])), mass_kg, float(torque[0])),
        time,
        motion.x_m,
        0.23 - 0.02 * np.tanh(np.abs(motion.x_m)),
        rear_wheel_speed_rad_s=motion.rear_wheel_rad_s,
        front_wheel_speed_rad_s=motion.front_wheel_rad_s,
        body_speed_m_s=motion.speed_m_s,
        controls=ObservedControls(_if_changing(slope), _if_changing(torque), brake if brake.any() else None),
    )


def made_runs(engine: Engine) -> list[ObservedRun]:
    """Four constant slopes and two drives, a few seconds each."""
    runs = [
        made_run(
            engine,
            f"slope {deg}",
            Track.constant(np.radians(deg)),
            Controls.constant(torque),
            mass_kg=mass,
            horizon_s=4,
        )
        for deg, torque, mass in ((5.0, 60.0, 430.0), (15.0, 80.0, 600.0), (22.0, 60.0, 430.0), (-8.0, 30.0, 800.0))
    ]
    bend = Track(np.array([0.8, 1.6]), np.radians([5.0, 18.0]))
    stop = Controls(np.array([0.0, 2.0, 3.0]), np.array([60.0, 0.0, 80.0]), np.array([0.0, 1.0, 0.0]))
    runs.append(made_run(engine, "bend", bend, Controls.constant(70.0), mass_kg=500.0, horizon_s=5))
    runs.append(made_run(engine, "stop", Track.constant(np.radians(10.0)), stop, mass_kg=430.0, horizon_s=5))
    return runs


def _if_changing(column: Array) -> Array | None:
    return column if np.ptp(column) > 0 else None
