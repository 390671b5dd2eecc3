"""From stored datasets to what learning takes: observed runs, and the rover and regolith they share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from model_store import DatasetRecord, ModelStore
from service.datasets import Passport, Run, read_parquet
from service.errors import TrainingError
from service.learning.observed import Controls, ObservedRun
from service.physics.parameters import LUNAR_REGOLITH, VIPER, RegolithParameters, RoverParameters
from service.physics.scenario import Scenarios
from service.training.stored_dataset import RUNS_FILE

_COLUMNS = ("time_s", "rear_x_m", "rear_y_m", "rear_omega_radps", "front_omega_radps", "speed_mps")


@dataclass(frozen=True, slots=True)
class TrainingData:
    """Runs of one or more datasets that were simulated with the same rover on the same regolith."""

    records: tuple[DatasetRecord, ...]
    runs: tuple[ObservedRun, ...]
    rover: RoverParameters
    regolith: RegolithParameters
    reference_body: str
    frame: str


def load_training_data(store: ModelStore, references: Sequence[str]) -> TrainingData:
    """The runs of the named datasets, in that order.

    Raises TrainingError when the datasets disagree on rover, regolith or reference body or share a run, and what the
    store and `read_parquet` raise.
    """
    records = [store.dataset(reference) for reference in references]
    datasets = [read_parquet(store.read_dataset_file(record.id, RUNS_FILE), columns=_COLUMNS) for record in records]
    runs = tuple(_observed(run) for dataset in datasets for run in dataset.runs)
    names = [run.name for run in runs]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise TrainingError(f"runs are in more than one of the datasets: {', '.join(repeated[:5])}")
    require_same_simulation([(dataset.name, dataset.passport) for dataset in datasets])
    passport = datasets[0].passport
    parameters = rover_of(passport), regolith_of(passport)
    return TrainingData(tuple(records), runs, *parameters, passport.reference_body, passport.frame)


def require_same_simulation(passports: Sequence[tuple[str, Passport]]) -> None:
    """Raises TrainingError naming the datasets, given as (name, passport), that no one model can be trained on."""
    first_name, first = passports[0]
    for other_name, other in passports[1:]:
        for what, one, two in (
            ("rover", rover_of(first), rover_of(other)),
            ("regolith", regolith_of(first), regolith_of(other)),
            ("reference body", first.reference_body, other.reference_body),
        ):
            if one != two:
                raise TrainingError(f"datasets {first_name} and {other_name} disagree on the {what}: {one} and {two}")


def rover_of(passport: Passport) -> RoverParameters:
    """The rover of a passport; what it leaves out is VIPER's."""
    given: dict[str, Any] = {
        "wheel_radius_m": passport.rover.wheel_radius_m,
        "wheelbase_m": passport.rover.wheelbase_m,
        "wheels": passport.rover.wheels,
        "centre_of_mass_ahead_of_rear_axle_m": passport.rover.centre_of_mass_ahead_of_rear_axle_m,
        "centre_of_mass_height_m": passport.rover.centre_of_mass_above_surface_m,
        "no_load_speed_rad_s": passport.drive.no_load_speed_rad_s if passport.drive else None,
    }
    return replace(VIPER, **{name: value for name, value in given.items() if value is not None})


def regolith_of(passport: Passport) -> RegolithParameters:
    """Gravity and soil of a passport; what it leaves out is the lunar regolith's."""
    soil = passport.soil
    given = {
        "gravity_m_s2": passport.gravity_m_s2,
        "bekker_kc": soil.bekker_kc if soil else None,
        "bekker_kphi": soil.bekker_kphi if soil else None,
        "bekker_n": soil.bekker_n if soil else None,
        "cohesion_pa": soil.mohr_cohesion_pa if soil else None,
        "friction_angle_rad": math.radians(soil.mohr_friction_deg) if soil and soil.mohr_friction_deg else None,
        "shear_modulus_m": soil.janosi_shear_m if soil else None,
    }
    return replace(LUNAR_REGOLITH, **{name: value for name, value in given.items() if value is not None})


def _observed(run: Run) -> ObservedRun:
    wheels = [run.columns[name] for name in ("rear_omega_radps", "front_omega_radps") if name in run.columns]
    return ObservedRun(
        name=run.name,
        set_name=run.set_name,
        scenario=Scenarios.of(run.slope_deg, run.mass_kg, run.torque_nm),
        time_s=run.time_s,
        x_m=run.x_m,
        y_m=run.y_m,
        mean_wheel_speed_rad_s=float(np.mean(wheels)) if wheels else None,
        rear_wheel_speed_rad_s=run.columns.get("rear_omega_radps"),
        front_wheel_speed_rad_s=run.columns.get("front_omega_radps"),
        body_speed_m_s=run.columns.get("speed_mps"),
        controls=_controls(run),
    )


def _controls(run: Run) -> Controls:
    slope_deg, brake = run.columns.get("slope_deg"), run.columns.get("brake")
    return Controls(
        slope_angle_rad=None if slope_deg is None else np.radians(slope_deg),
        torque_nm=run.columns.get("torque_nm"),
        brake=None if brake is None else brake > 0,
    )
