"""What tilting gravity leaves out: `python -m tests.benchmarks.kinks`.

For docs/fidelity.md. The runs of `kink` drive over ground that bends; those of `steps` with the same number are the
same scenarios on flat ground, with gravity tilted. The champion was trained on the latter, and drives them here.

Chrono writes x and y in the frame of the first slope, beyond the bend too. Here they are along and normal to the
ground: the wheel centre's path is bent back where it turns, on the bisector of the bend.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from model_store import ModelStore
from service.learning.drive.model import DriveModel
from service.learning.evaluate import way_m
from service.learning.observed import ObservedRun
from service.physics.scenario import Array
from service.settings import load_settings
from service.training.data import load_training_data
from service.twin.load import load_twin
from tests.benchmarks.fidelity_floor import table

COLUMNS = "run|way, m|x at the end, cm|largest|of the way, %|y at the end, cm|largest"


def differences(of: tuple[Array, Array], to: ObservedRun) -> list[float]:
    """x and y minus those of a run at its times: at the end and the largest, cm, and that of x over its way, %."""
    x, y = (100.0 * (mine - its) for mine, its in zip(of, (to.x_m, to.y_m), strict=True))
    largest = [float(each[np.abs(each).argmax()]) for each in (x, y)]
    return [float(x[-1]), largest[0], float(abs(x[-1])) / way_m(to), float(y[-1]), largest[1]]


def bend_of(run: ObservedRun, wheelbase_m: float) -> tuple[float, float]:
    """Where the ground bends (m from the rear wheel's start) and by how much (rad): the middle met it there."""
    slope = run.slope_angle_rad
    row = int(np.flatnonzero(np.diff(slope))[0]) + 1
    return float(run.x_m[row] - run.x_m[0]) + 0.5 * wheelbase_m, float(slope[-1] - slope[0])


def unbent(run: ObservedRun, wheelbase_m: float) -> ObservedRun:
    """The same run with x along the ground and y normal to it."""
    at, angle = bend_of(run, wheelbase_m)
    height = float(np.median(run.y_m[run.x_m < 0.5 * at]))
    turn = at - height * np.tan(0.5 * angle)  # where a wheel of this height touches both sides of the bend
    ahead, above = run.x_m - turn, run.y_m - height
    along = turn + ahead * np.cos(angle) + above * np.sin(angle)
    normal = height - ahead * np.sin(angle) + above * np.cos(angle)
    beyond = ahead > 0.0
    return replace(run, x_m=np.where(beyond, along, run.x_m), y_m=np.where(beyond, normal, run.y_m))


def named(run: ObservedRun) -> str:
    """Its number, mass and torque, and from which slope to which it goes."""
    first, last = (np.degrees(run.slope_angle_rad[[0, -1]])).round(1)
    return f"{first:g}° to {last:g}°, {run.mass_kg:g} kg, {run.torque_nm:g} N m"


def main() -> None:
    """Print both tables."""
    store = ModelStore.open(load_settings().store_url)
    twin = load_twin(store, "viper-lunar", store.alias("viper-lunar", "champion").version)
    model = cast(DriveModel, twin.model)
    data = load_training_data(store, ["kink"])
    bent = [unbent(run, data.rover.wheelbase_m) for run in data.runs]
    tilted = {run.name.replace("_slope", "_kink"): run for run in load_training_data(store, ["steps"]).runs}
    added = [float(100 * (two.x_m[-1] - one.x_m[-1])) for one, two in zip(data.runs, bent, strict=True)]
    table("What bending back adds to x at the end", "run|cm", zip(map(named, bent), added, strict=True))
    pairs = [(run, tilted[run.name]) for run in bent]
    rows = [[named(run), way_m(run), *differences((flat.x_m, flat.y_m), run)] for run, flat in pairs]
    table("`steps` minus `kink`", COLUMNS, rows)
    for title, runs in (("`steps`", [flat for _, flat in pairs]), ("`kink`", [run for run, _ in pairs])):
        said = [model.drive_run(run) for run in runs]
        rows = [
            [named(run), way_m(run), *differences((each.x_m[0], each.y_m[0]), run)]
            for run, each in zip(runs, said, strict=True)
        ]
        table(f"{twin.name} {twin.version} minus {title}", COLUMNS, rows)


if __name__ == "__main__":
    main()
