"""Fitting the resistance process: traction curves, then three Gaussian processes, each solved once in closed form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from service.learning.observed import ObservedRun, require_constant, scenarios_of
from service.learning.resistance.curve_fit import fit_curves
from service.learning.resistance.features import scaled_features, stall_gate
from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.kernels import ScenarioFeatures
from service.learning.resistance.model import ResistanceProcess
from service.learning.resistance.process import SolvedProcess, TrainingPoints
from service.learning.resistance.segments import Segments, segments_of
from service.learning.resistance.start import fit_start, start_features
from service.learning.resistance.tables import time_knots
from service.learning.resistance.traction import SpeedLaw, TractionCurves, rut_blend, speed_law
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.prior import Prior
from service.physics.scenario import Positions
from service.physics.similarity import torque_ratio

# Memory and time grow with the square and the cube of the points: 12,000 take 2.3 GB.
_MOST_POINTS = 12_000


@dataclass(frozen=True, slots=True)
class FittedProcess:
    """The model of all runs, and for each run by name what a model without that run predicts at its `time_s`."""

    model: ResistanceProcess
    left_out: dict[str, Positions]


def fit_resistance_process(
    runs: Sequence[ObservedRun],
    rover: RoverParameters,
    regolith: RegolithParameters,
    prior: Prior,
    *,
    hyper: Hyperparameters | None = None,
    progress: Callable[[str], None] | None = None,
    check: Callable[[], None] = lambda: None,
) -> FittedProcess:
    """Fits the model to runs and predicts each run without it. Deterministic: nothing is drawn, nothing iterates.

    `check` is called every second or so, and may raise to stop the fit; so may `progress`.
    For the left-out predictions the hyperparameters and the traction curves (13 numbers) stay those of all runs.
    Raises ValueError for fewer than three runs, for too many, for names that repeat, for a motor without a no-load
    speed, and for a prior of another rover or regolith, TrainingError for runs whose slope, torque or brake change.
    """
    hyper = hyper or Hyperparameters()
    _require_usable(runs, rover, regolith, prior)
    tell = progress or _say_nothing
    curves = fit_curves(runs, rover, regolith, hyper)
    tell("traction curves fitted")
    laws = [_law(run, rover, regolith, curves, hyper) for run in runs]
    pieces = [segments_of(run) for run in runs]
    scaled = scaled_features(scenarios_of(runs), rover, regolith, hyper)
    features = ScenarioFeatures(scaled, stall_gate(scaled, np.array([law.margin for law in laws]), hyper))
    knots = time_knots(max(run.horizon_s for run in runs))
    resistance = _points(runs, pieces, laws, regolith, hyper)
    tell(f"solving for the resistance at {len(resistance.target)} points")
    solved = SolvedProcess(hyper.resistance, features, resistance, knots, check)
    resistance_tables, resistance_left = solved.tables(), list(solved.left_out())
    del solved  # its matrices are large
    tell("solving for the height")
    solved = SolvedProcess(hyper.height, features, _height_points(resistance, pieces), knots, check)
    height_tables, height_left = solved.tables(), list(solved.left_out())
    angle = np.concatenate([run.scenario.slope_angle_rad for run in runs])
    speed, height = (
        np.array(each) for each in zip(*((p.start_speed_m_s, p.start_height_m) for p in pieces), strict=True)
    )
    start, start_left = fit_start(start_features(angle, scaled[:, 2]), speed, height)
    model = ResistanceProcess(prior, hyper, curves, features, knots, resistance_tables, height_tables, start)
    tell("predicting every run without it")
    left_out = {}
    for run, rho, y, begin in zip(runs, resistance_left, height_left, start_left, strict=True):
        check()
        without = replace(model, resistance=rho, height=y, start=begin)
        left_out[run.name] = without.positions(run.scenario, run.time_s)
    return FittedProcess(model, left_out)


def _say_nothing(message: str) -> None:
    """For callers who do not watch: `message` goes nowhere."""


def _require_usable(
    runs: Sequence[ObservedRun], rover: RoverParameters, regolith: RegolithParameters, prior: Prior
) -> None:
    if len(runs) < 3:
        raise ValueError(f"a resistance process needs three runs at least, got {len(runs)}")
    if len({run.name for run in runs}) < len(runs):
        raise ValueError("names of runs repeat")
    if not np.isfinite(rover.no_load_speed_rad_s):
        raise ValueError("no_load_speed_rad_s is infinite, a resistance process needs a finite one")
    if prior.rover != rover or prior.regolith != regolith:
        raise ValueError("the prior was made for another rover or regolith than the runs")
    require_constant(runs)


def _law(
    run: ObservedRun,
    rover: RoverParameters,
    regolith: RegolithParameters,
    curves: TractionCurves,
    hyper: Hyperparameters,
) -> SpeedLaw:
    ratio = float(torque_ratio(rover, regolith, run.scenario)[0])
    return speed_law(rover, curves, hyper, float(run.scenario.slope_angle_rad[0]), ratio, run.mass_kg)


def _points(
    runs: Sequence[ObservedRun],
    pieces: Sequence[Segments],
    laws: Sequence[SpeedLaw],
    regolith: RegolithParameters,
    hyper: Hyperparameters,
) -> TrainingPoints:
    """rho = F(v, x) - sin th - (dv/dt)/g of each segment, over its mass scale and less the prior mean."""
    sizes = [len(piece.time_s) for piece in pieces]
    if sum(sizes) > _MOST_POINTS:
        raise ValueError(f"the runs come to {sum(sizes)} points, allowed are {_MOST_POINTS}: leave out runs")
    scale = np.repeat([(run.mass_kg / hyper.reference_mass_kg) ** hyper.mass_exponent for run in runs], sizes)
    push = np.concatenate(
        [law.at(p.speed_m_s, rut_blend(hyper, p.travel_m)) for law, p in zip(laws, pieces, strict=True)]
    )
    duration, time, travel, change = (
        np.concatenate([getattr(piece, name) for piece in pieces])
        for name in ("duration_s", "time_s", "travel_m", "speed_change_m_s")
    )
    gain = 1.0 / (regolith.gravity_m_s2 * duration)
    target = (push - change * gain) / scale - hyper.mean_resistance
    starts = tuple(int(start) for start in np.concatenate([[0], np.cumsum(sizes)]))
    return TrainingPoints(starts, duration, time, travel, target, gain, scale)


def _height_points(points: TrainingPoints, pieces: Sequence[Segments]) -> TrainingPoints:
    """The same points with the height over that at release as target."""
    target = np.concatenate([piece.height_m - piece.start_height_m for piece in pieces])
    nothing = np.zeros_like(target)
    return replace(points, target=target, speed_noise=nothing, scale=np.ones_like(target))
