"""How exact a model of the shipped runs can be: `python -m tests.benchmarks.fidelity_floor [SET ...]`.

For docs/fidelity.md. Without sets: paper, mass, space, stall and threshold. Fits the drive model a few times.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicSpline

from model_store import ModelStore
from service.learning.drive.fit import fit_drive
from service.learning.drive.model import DriveModel
from service.learning.evaluate import LEAST_WAY_M, way_m
from service.learning.observed import ObservedRun, scenarios_of
from service.physics.priors import make_prior
from service.physics.scenario import Array
from service.physics.similarity import torque_ratio
from service.settings import load_settings
from service.training.data import TrainingData, load_training_data

SETS = ("paper", "mass", "space", "stall", "threshold")
TWIN_DEG, TWIN_NM = 0.025, 0.06  # runs that are no further apart should end alike
SMALL = 1e-4  # of the weight: the resistance is shifted by this to see what it moves
MOST = 0.12


@dataclass(frozen=True, slots=True)
class Errors:
    """x errors and ways (m, half a metre at least), error over way; one value per run."""

    final: Array
    maximum: Array
    way: Array
    relative: Array

    @classmethod
    def of(cls, runs: Sequence[ObservedRun], predicted: Iterable[Array]) -> Errors:
        """Compare predictions at the runs' own times."""
        pairs = list(zip(runs, predicted, strict=True))
        final = np.array([x[-1] - run.x_m[-1] for run, x in pairs])
        way = np.array([max(way_m(run), LEAST_WAY_M) for run in runs])
        return cls(final, np.array([abs(x - run.x_m).max() for run, x in pairs]), way, abs(final) / way)


def end(model: DriveModel, run: ObservedRun, offset: float = 0.0) -> float:
    """Where the model says that a run ends (m), with `offset` added to the resistance all along."""
    return float(model.drive_run(run, offset).x_m[0, -1])


def sensitivity(model: DriveModel, run: ObservedRun) -> float:
    """How much less far the rover gets (m) by resistance (fraction of the weight)."""
    return max((end(model, run, -SMALL) - end(model, run, SMALL)) / (2 * SMALL), 1e-3)


def offset_that_mends(model: DriveModel, run: ObservedRun) -> float:
    """The offset with which a left-out prediction ends where the run did."""
    low, high = -MOST, MOST
    for _ in range(24):  # more resistance never takes a rover further
        middle = (low + high) / 2.0
        low, high = (middle, high) if end(model, run, middle) > run.x_m[-1] else (low, middle)
    return low


def table(title: str, columns: str, rows: Iterable[Sequence[object]]) -> None:
    """Print Markdown; `columns` are separated by |."""
    print(f"\n### {title}\n\n| {columns.replace('|', ' | ')} |\n|---|{'---:|' * columns.count('|')}")
    for row in rows:
        print(f"| {' | '.join(map(cell, row))} |", flush=True)


def cell(value: object) -> str:
    """Arrays as median / 90th percentile, runs as slope, mass and torque."""
    if isinstance(value, ObservedRun):
        return f"{value.slope_deg:g}°, {value.mass_kg:g} kg, {value.torque_nm:g} N m"
    if isinstance(value, np.ndarray):
        return f"{np.median(value):.3g} / {np.quantile(value, 0.9):.3g}"
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def twins(model: DriveModel, runs: Sequence[ObservedRun]) -> float:
    """What runs of almost one scenario end apart, as a scatter of the resistance; its median over the pairs."""
    rows, found = [], []
    for one, other in combinations([run for run in runs if not run.varies], 2):
        near = abs(one.slope_deg - other.slope_deg) <= TWIN_DEG and abs(one.torque_nm - other.torque_nm) <= TWIN_NM
        if near and one.mass_kg == other.mass_kg and one.horizon_s == other.horizon_s:
            expected = end(model, one) - end(model, other)
            apart = abs(float(one.x_m[-1] - other.x_m[-1]) - expected)
            found.append(apart / sensitivity(model, one) / np.sqrt(2.0))
            rows.append([one, other, 100 * apart, 1e3 * found[-1]])
    table("Twins", "run|and|end apart but for the model's difference, cm|scatter of the resistance, 0.001", rows)
    return float(np.median(found)) if found else float("nan")


def floor(
    model: DriveModel, left_out: Mapping[str, DriveModel], runs: Sequence[ObservedRun], errors: Errors, scatter: float
) -> None:
    """What scatter of the simulations alone leaves, beside what the model gets wrong."""
    gain = np.array([sensitivity(model, run) for run in runs])
    least, sets, rows = scatter * gain, list(dict.fromkeys(run.set_name for run in runs)), []
    for name in sets:
        own = np.array([run.set_name == name for run in runs])
        columns = 0.1 * gain, 100 * least, 100 * least / errors.way, 100 * abs(errors.final), 100 * errors.relative
        rows.append([name, str(own.sum()), *(each[own] for each in columns)])
    names = "set|runs|sensitivity, cm per 0.001|floor, cm|floor, %|left-out error, cm|error, %"
    table("Sensitivity and floor: median / 90 %", names, rows)
    rows = []
    for row in np.argsort(-errors.relative)[:12]:
        run, without = runs[row], left_out[runs[row].name]
        numbers = 100 * errors.relative[row], 0.1 * gain[row], 1e3 * offset_that_mends(without, run)
        rows.append([run, run.set_name, f"{run.x_m[-1]:.3f}", *map(float, numbers), 1e3 * scatter])
    names = "run|set|ends at x, m|error, %|sensitivity, cm|offset that mends it|scatter"
    table("Largest relative errors", names, rows)


def interpolated(slopes: Array, x: Array, row: int, nearest: int, degree: int) -> Array:
    """Per instant a polynomial in slope through or near the nearest other slopes."""
    near = np.argsort(abs(slopes - slopes[row]), kind="stable")[1 : nearest + 1]
    return np.asarray(np.polynomial.polynomial.polyfit(slopes[near] - slopes[row], x[near], degree)[0])


def by_slope(data: TrainingData, left: Mapping[str, Array]) -> None:
    """Leave one slope of the paper set out: interpolations beside the model."""
    runs = [run for run in data.runs if run.set_name == "paper"]
    slopes, x = np.array([run.slope_deg for run in runs]), np.array([run.x_m for run in runs])
    ways = [[CubicSpline(np.delete(slopes, r), np.delete(x, r, axis=0))(slopes[r]) for r in range(len(runs))]]
    ways += [[interpolated(slopes, x, r, *way) for r in range(len(runs))] for way in ((4, 3), (6, 2))]
    alone = fit_drive(runs, make_prior("motor_slope", 0.0, data.rover, data.regolith)).left_out
    ways += [[alone[run.name].x_m[0] for run in runs], [left[run.name] for run in runs]]
    errors = [Errors.of(runs, way) for way in ways]
    cells = [[f"{100 * a:.2f} / {100 * b:.2f}" for a, b in zip(e.final, e.maximum, strict=True)] for e in errors]
    rows = [[f"{s:g}°", *row] for s, row in zip(slopes, zip(*cells, strict=True), strict=True)]
    inner = (slopes >= 22) & (slopes <= 29)
    rows.append(["rms, 22° to 29°", *(f"{100 * np.sqrt(np.mean(e.final[inner] ** 2)):.2f}" for e in errors)])
    names = "slope|spline|cubic, 4|parabola, 6|model, other slopes|model, all other runs"
    table("Leave one slope out: final / maximum error in x, cm", names, rows)


def heavy(data: TrainingData) -> None:
    """860 kg at 28 deg without the mass set: interpolation per instant between scenarios, and the model."""
    run = next(each for each in data.runs if each.set_name == "mass" and each.slope_deg == 28)
    others = [each for each in data.runs if each.set_name in ("paper", "space")]
    x = np.array([np.interp(run.time_s, each.time_s, each.x_m) for each in others])
    every = scenarios_of([run, *others])
    ratio = np.log(torque_ratio(data.rover, data.regolith, every))
    places = np.column_stack([np.tan(every.slope_angle_rad), ratio, np.log(every.mass_kg)])
    places /= places.std(axis=0)
    shift, predicted = places[1:] - places[0], {}
    order = np.argsort(np.square(shift).sum(axis=1))
    for count in (12, 16, 24):
        near = order[:count]
        terms = np.column_stack([np.ones(count), shift[near], np.square(shift[near])])
        predicted[f"plane, {count} nearest"] = np.linalg.lstsq(terms[:, :4], x[near], rcond=None)[0][0]
        predicted[f"parabolas, {count} nearest"] = np.linalg.lstsq(terms, x[near], rcond=None)[0][0]
    prior = make_prior("motor_slope", 0.0, data.rover, data.regolith)
    predicted["model"] = fit_drive(others, prior).model.drive_run(run).x_m[0]
    errors = Errors.of([run] * len(predicted), predicted.values())
    rows = [[name, 100 * errors.final[i], 100 * errors.maximum[i]] for i, name in enumerate(predicted)]
    table("860 kg, 120 N m, 28° from paper and space: error in x, cm", "from|final|maximum", rows)


def main() -> None:
    """Print every table."""
    data = load_training_data(ModelStore.open(load_settings().store_url), sys.argv[1:] or SETS)
    fitted = fit_drive(data.runs, make_prior("motor_slope", 0.0, data.rover, data.regolith))
    left = {name: positions.x_m[0] for name, positions in fitted.left_out.items()}
    errors = Errors.of(data.runs, [left[run.name] for run in data.runs])
    floor(fitted.model, fitted.left_out_models, data.runs, errors, twins(fitted.model, data.runs))
    by_slope(data, left)
    heavy(data)


if __name__ == "__main__":
    main()
