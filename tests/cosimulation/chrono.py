"""A recorded run of Chrono as a testbed has it: a terrain, controls, and where the rover went."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import model_store
from model_store import ModelStore
from service.learning.drive.recorded import controls_of, track_of
from service.physics.scenario import Array
from service.training.data import load_training_data
from tests.cosimulation.lockstep import Terrain, Told


@dataclass(frozen=True, slots=True)
class ChronoDrive:
    """`time_s` and `x_m` (time,) are Chrono's own."""

    mass_kg: float
    terrain: Terrain
    controls: list[Told]
    until_s: float
    time_s: Array
    x_m: Array


def chrono_drive(name: str) -> ChronoDrive:
    """One run of the shipped dataset `drive`."""
    data = load_training_data(ModelStore.open(str(next(iter(model_store.__path__)))), ["drive"])
    run = next(each for each in data.runs if each.name == name)
    track, controls = track_of(run, data.rover), controls_of(run)
    columns = zip(
        controls.time_s.tolist(), controls.torque_nm.tolist(), np.asarray(controls.brake).tolist(), strict=True
    )
    return ChronoDrive(
        mass_kg=run.mass_kg,
        terrain=Terrain(track.distance_m, np.degrees(track.slope_rad)),
        controls=[Told(time_s, torque_nm, brake > 0) for time_s, torque_nm, brake in columns],
        until_s=float(run.time_s[-1]),
        time_s=run.time_s,
        x_m=run.x_m - run.x_m[0],
    )
