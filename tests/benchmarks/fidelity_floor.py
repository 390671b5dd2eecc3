"""How exact a model of the shipped runs can be, as in docs/fidelity.md: `python -m tests.benchmarks.fidelity_floor`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_solve

from model_store import ModelStore
from service.learning.band import Band
from service.learning.domain import Domain
from service.learning.observed import ObservedRun, scenarios_of
from service.learning.resistance import curve_fit, features, kernels, process, segments, start, tables
from service.learning.resistance import fit as fitting
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.model import ResistanceProcess
from service.physics.priors import make_prior
from service.physics.scenario import Array
from service.settings import load_settings
from service.training.data import TrainingData, load_training_data
from service.twin.summary import LAST_PART, Outcome, outcome_of

# Known of the simulations: runs 0.02 deg apart end so far apart (m) with the effect of the slope removed.
TWINS_M = {24.0: 0.002, 29.0: 0.009}
HYPER = Hyperparameters()


class Fit:
    """The process of some runs, and what it becomes without any of them; only x is predicted."""

    def __init__(self, data: TrainingData, runs: Sequence[ObservedRun], hyper: Hyperparameters = HYPER) -> None:
        self.runs, rover, regolith = list(runs), data.rover, data.regolith
        curves = curve_fit.fit_curves(runs, rover, regolith, hyper)
        laws = [fitting._law(run, rover, regolith, curves, hyper) for run in runs]
        pieces = [segments.segments_of(run) for run in runs]
        scaled = features.scaled_features(scenarios_of(runs), rover, regolith, hyper)
        self.margin = np.array([law.margin for law in laws])
        known = kernels.ScenarioFeatures(scaled, features.stall_gate(scaled, self.margin, hyper))
        points, knots = fitting._points(runs, pieces, laws, regolith, hyper), tables.time_knots(10.0)
        self._solved = process.SolvedProcess(hyper.resistance, known, points, knots)
        angle = np.concatenate([run.scenario.slope_angle_rad for run in runs])
        speed, height = np.array([(piece.start_speed_m_s, piece.start_height_m) for piece in pieces]).T
        begin, self._starts = start.fit_start(start.start_features(angle, scaled[:, 2]), speed, height)
        prior, solution = make_prior("motor_slope", 0.0, rover, regolith), self._solved.tables()
        self.model = ResistanceProcess(prior, hyper, curves, known, knots, solution, solution, begin)

    def left_out(self) -> list[ResistanceProcess]:
        """For each run the model without it."""
        each = zip(self._solved.left_out(), self._starts, strict=True)
        return [replace(self.model, resistance=solution, start=begin) for solution, begin in each]

    def without(self, rows: Sequence[int]) -> ResistanceProcess:
        """The model without several runs; how a run starts is known without the first of them."""
        points, weights = self._solved.points, self._solved.weights
        inside = np.concatenate([np.arange(len(weights))[points.of_run(row)] for row in rows])
        columns = cho_solve((self._solved._factor, False), np.eye(len(weights))[:, inside])
        weights = weights - columns @ np.linalg.solve(columns[inside], weights[inside])
        weights[inside] = 0.0
        return replace(self.model, resistance=self._solved.tables(weights), start=self._starts[rows[0]])

    def shifted(self, row: int, offset: float, model: ResistanceProcess | None = None) -> Array:
        """x (m) of a run from `model` (that of all runs) with `offset` added to the resistance all along."""
        model, hyper, run = model or self.model, self.model.hyper, self.runs[row]
        known, solution = model.features, model.resistance
        here = kernels.ScenarioFeatures(known.scaled[row : row + 1], known.gate[row : row + 1])
        level = kernels.scenario_kernels(hyper.resistance, here, known).level[0]
        share = offset / (run.mass_kg / hyper.reference_mass_kg) ** hyper.mass_exponent / (level @ level)
        return travel(replace(model, resistance=replace(solution, level=solution.level + share * level)), run)

    def offset_that_mends(self, row: int, model: ResistanceProcess) -> float:
        """The offset (-0.12 to 0.12) with which a left-out prediction ends where the run did."""
        low, high = -0.12, 0.12
        for _ in range(24):  # more resistance never takes a rover further
            middle = (low + high) / 2.0
            beyond = self.shifted(row, middle, model)[-1] > self.runs[row].x_m[-1]
            low, high = (middle, high) if beyond else (low, middle)
        return low


@dataclass(frozen=True, slots=True)
class Errors:
    """x errors and distances (m; at least 5 cm), error over distance; one value per run."""

    final: Array
    maximum: Array
    reach: Array
    relative: Array

    @classmethod
    def of(cls, runs: Sequence[ObservedRun], predicted: Iterable[Array]) -> Errors:
        """Compare predictions at the runs' own times."""
        pairs = list(zip(runs, predicted, strict=True))
        final = np.array([x[-1] - run.x_m[-1] for run, x in pairs])
        far = np.array([max(abs(run.x_m[-1]), 0.05) for run in runs])
        return cls(final, np.array([abs(x - run.x_m).max() for run, x in pairs]), far, abs(final) / far)


def travel(model: ResistanceProcess, run: ObservedRun) -> Array:
    """x (m) at the run's times."""
    return np.asarray(model.positions(run.scenario, run.time_s).x_m[0])


def outcome(run: ObservedRun, x: Array, doubt_m: float = 0.0) -> Outcome:
    """Climbs, stalls or slides, with `doubt_m` added to the last quarter's displacement."""
    way = x[-1] - np.interp((1.0 - LAST_PART) * run.horizon_s, run.time_s, x)
    return outcome_of((float(way) + doubt_m) / (LAST_PART * run.horizon_s))


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


def interpolated(slopes: Array, x: Array, row: int, nearest: int, degree: int) -> Array:
    """Per instant a polynomial in slope through or near the nearest other slopes."""
    near = np.argsort(abs(slopes - slopes[row]), kind="stable")[1 : nearest + 1]
    return np.asarray(np.polynomial.polynomial.polyfit(slopes[near] - slopes[row], x[near], degree)[0])


def floor(fit: Fit, models: Sequence[ResistanceProcess], errors: Errors) -> None:
    """What scatter of the simulations alone leaves, beside what the model gets wrong."""
    runs, far = fit.runs, errors.reach

    def swing(offsets: Array) -> Array:
        return np.array([fit.shifted(r, -d)[-1] - fit.shifted(r, d)[-1] for r, d in enumerate(offsets)]) / 2.0

    gain = swing(np.full(len(runs), 1e-4)) / 1e-4
    paper = {run.slope_deg: row for row, run in enumerate(runs) if run.set_name == "paper"}
    known = {s: twins / gain[paper[s]] / np.sqrt(2.0) for s, twins in TWINS_M.items()}
    places = sorted((fit.margin[paper[s]], value) for s, value in known.items())
    scatter = np.exp(np.interp(fit.margin, [place for place, _ in places], np.log([value for _, value in places])))
    slopes, ends = np.array(list(paper)), np.array([runs[row].x_m[-1] for row in paper.values()])
    misses = [(interpolated(slopes, ends, s, 4, 3) - ends[s]) / gain[paper[slopes[s]]] for s in range(2, 9)]
    rows = [[f"two runs 0.02° apart, {s:g}°", 1e3 * value] for s, value in known.items()]
    rows.append(["22° to 28° of the paper set", 1e3 * float(np.sqrt(np.mean(np.square(misses)) / (1 + 34 / 36)))])
    table("Scatter of the resistance, 0.001 of the weight", "from|scatter", rows)
    least, space = abs(swing(scatter)), np.array([run.set_name == "space" for run in runs])
    up, steep = np.array([run.x_m[-1] > 0.3 for run in runs]), np.array([run.slope_deg == 28 for run in runs])
    groups = {"space, climbing": space & up, "space, others": space & ~up, "space": space}
    groups |= {f"{name}, 28°": steep & [run.set_name == name for run in runs] for name in ("paper", "mass")}
    columns = (0.1 * gain, 100 * least, 100 * least / far, 100 * abs(errors.final), 100 * errors.relative)
    rows = [[name, str(sum(group)), *(each[group] for each in columns)] for name, group in groups.items()]
    table("Sensitivity and floor: median / 90 %", "runs|count|sensitivity|floor, cm|floor, %|error, cm|error, %", rows)
    rows = []
    for row in np.argsort(-errors.relative)[:8]:
        offset = fit.offset_that_mends(row, models[row])
        rest = abs(fit.shifted(row, offset, models[row]) - runs[row].x_m).max()
        numbers = [100 * errors.relative[row], 0.1 * gain[row], 1e3 * offset, 50 * far[row] / gain[row]]
        rows.append([runs[row], f"{runs[row].x_m[-1]:.3f}", *numbers, 1e3 * scatter[row], 100 * rest])
    names = "run|ends at x, m|error, %|sensitivity, cm|offset that mends it|5 % allows|scatter|then at most off, cm"
    table("Largest relative errors", names, rows)


def by_slope(data: TrainingData, left: Sequence[Array]) -> None:
    """Leave one slope of the paper set out: interpolations beside the model."""
    runs = [run for run in data.runs if run.set_name == "paper"]
    slopes, x = np.array([run.slope_deg for run in runs]), np.array([run.x_m for run in runs])
    ways = [[CubicSpline(np.delete(slopes, r), np.delete(x, r, axis=0))(slopes[r]) for r in range(len(runs))]]
    ways += [[interpolated(slopes, x, r, *way) for r in range(len(runs))] for way in ((4, 3), (6, 2))]
    ways += [list(map(travel, Fit(data, runs).left_out(), runs)), [left[data.runs.index(run)] for run in runs]]
    errors = [Errors.of(runs, way) for way in ways]
    cells = [[f"{100 * a:.2f} / {100 * b:.2f}" for a, b in zip(e.final, e.maximum, strict=True)] for e in errors]
    rows = [[f"{s:g}°", *row] for s, row in zip(slopes, zip(*cells, strict=True), strict=True)]
    inner = (slopes >= 22) & (slopes <= 29)
    rows.append(["rms, 22° to 29°", *(f"{100 * np.sqrt(np.mean(e.final[inner] ** 2)):.2f}" for e in errors)])
    names = "slope|spline|cubic, 4|parabola, 6|model, other slopes|model, all other runs"
    table("Leave one slope out: final / maximum error in x, cm", names, rows)


def heavy(data: TrainingData) -> None:
    """860 kg at 28 deg without the mass set: interpolation per instant in the scaled features, and the model."""
    run = next(each for each in data.runs if each.set_name == "mass" and each.slope_deg == 28)
    others = [each for each in data.runs if each.set_name != "mass"]
    x = np.array([np.interp(run.time_s, each.time_s, each.x_m) for each in others])
    here, *places = features.scaled_features(scenarios_of([run, *others]), data.rover, data.regolith, HYPER)
    shift = np.array(places) - here
    order, predicted = np.argsort(np.square(shift).sum(axis=1)), {}
    for count in (12, 16, 24):
        near = order[:count]
        terms = np.column_stack([np.ones(count), shift[near], np.square(shift[near])])
        predicted[f"plane, {count} nearest"] = np.linalg.lstsq(terms[:, :4], x[near], rcond=None)[0][0]
        predicted[f"parabolas, {count} nearest"] = np.linalg.lstsq(terms, x[near], rcond=None)[0][0]
    predicted["model"] = travel(Fit(data, others).model, run)
    errors = Errors.of([run] * len(predicted), predicted.values())
    rows = [[name, 100 * errors.final[i], 100 * errors.maximum[i]] for i, name in enumerate(predicted)]
    table("860 kg, 120 N m, 28° from the other sets: error in x, cm", "from|final|maximum", rows)


def neighbours(fit: Fit) -> None:
    """How errors grow when the runs nearest to a left-out run are missing too."""
    scaled, space = fit.model.features.scaled, [r for r, run in enumerate(fit.runs) if run.set_name == "space"]
    distance, rows = np.sqrt(np.square(scaled[:, None] - scaled[None]).sum(axis=2)), []
    near = fit.margin[space] < 0.25  # they stall, slide or nearly do
    for missing in (0, 1, 2, 4):
        left = [travel(fit.without(np.argsort(distance[r])[: missing + 1].tolist()), fit.runs[r]) for r in space]
        errors, to = Errors.of([fit.runs[r] for r in space], left), np.sort(distance[space], axis=1)[:, missing + 1]
        parts = [each[group] for group in (near, ~near) for each in (to, 100 * errors.relative)]
        rows.append([str(missing), *parts])
    names = "nearest runs missing|near stall: distance|error, %|others: distance|error, %"
    table(f"{sum(near)} space runs near stall, {sum(~near)} others: median / 90 %", names, rows)


def outcomes(data: TrainingData) -> None:
    """Whether the band that is made without a run allows how the run really ended; shows runs in doubt."""
    prior, rows = make_prior("motor_slope", 0.0, data.rover, data.regolith), []
    left = fitting.fit_resistance_process(data.runs, data.rover, data.regolith, prior).left_out
    for run in data.runs:
        others, x = [other for other in data.runs if other is not run], left[run.name].x_m[0]
        domain = Domain.of_runs(others, data.rover, data.regolith, {other.name: 0.01 for other in others})
        band = Band.calibrate(others, {other.name: left[other.name] for other in others}, domain)
        end, at = np.array([run.horizon_s]), np.interp(band.look_s, run.time_s, x)[None]
        levels, kinds, allowed = (0.9, 0.5, 0.8, 0.95, 0.975, 0.99), list(Outcome), []
        for half in (float(band.half_widths(run.scenario, end, level, at)[0][0, -1]) for level in levels):
            best, worst = (kinds.index(outcome(run, x, side)) for side in (half, -half))
            allowed.append(kinds[best : worst + 1])
        truth, inside = outcome(run, run.x_m), domain.judge(run.slope_deg, run.mass_kg, run.torque_nm, 10.0).inside
        if allowed[0] != [truth]:
            first = min([level for level, few in zip(levels, allowed, strict=True) if truth in few], default=1.0)
            rows.append([run, truth, outcome(run, x), ", ".join(allowed[0]), first, "yes" if inside else "no"])
    table("Outcomes in doubt", "run|really|predicted|90 % band allows|true one from level|in the domain", rows)


def main() -> None:
    """Print every table."""
    data = load_training_data(ModelStore.open(load_settings().store_url), ["paper", "mass", "space"])
    fit = Fit(data, data.runs)
    left = list(map(travel, models := fit.left_out(), data.runs))
    floor(fit, models, Errors.of(data.runs, left))
    neighbours(fit)
    by_slope(data, left)
    heavy(data)
    outcomes(data)


if __name__ == "__main__":
    main()
