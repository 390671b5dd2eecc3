"""The band: an interval around x(t) and y(t) that holds the truth as often as it says, whatever model is inside it.

Cross-conformal over runs (Vovk 2015): each training run is predicted without itself; its errors, divided by the scale
that the *other* runs lead one to expect there, are scores. The band's half-width is that scale at the scenario asked
for, times the quantile of the scores at the level, each run weighing the same. The promise is pointwise: of all times
of all runs like the training runs, that share lies inside; not that whole trajectories do.

What is near is judged in slope, torque ratio, mass and in where the model itself sends the rover: how far (its reach)
and how far back on the way (its lowest x). Errors are millimetres where it climbs and decimetres where it stalls, and
the model knows better than distances which it is; and one that slides back before it climbs may as well go on sliding.

Beyond the trained horizon half-widths go on linearly, at the mean rate or the last rate, whichever is larger. Made
from the first 5 s of the 80 shipped Chrono runs, the 0.9 band held 91 % of them in x and 95 % in y at 10 s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import safetensors.numpy

from service.errors import CheckpointError, InvalidValueError
from service.learning.curves import interpolate_curves
from service.learning.domain import Domain
from service.learning.edges import Edges
from service.learning.error_scale import ErrorScale
from service.learning.left_out import LeftOutErrors, look_times
from service.learning.neighbourhood import Neighbourhood, chunks
from service.learning.observed import ObservedRun
from service.learning.trajectory_model import TrajectoryModel
from service.learning.weights import read_weights
from service.physics.scenario import Array, Positions, Scenarios

BAND_FILE = "report/band.safetensors"
LOWEST_LEVEL, HIGHEST_LEVEL, USUAL_LEVEL = 0.5, 0.99, 0.9
LEVELS = (0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.925, 0.95, 0.975, 0.99)
FEWEST_RUNS = 3
_LAST_PART = 0.25
# Both are compared as arcsinh(x / 0.3 m): by their ratio where the rover moves, by their difference where it hardly
# does. 0.3 m in 10 s is also where the figures draw the line between climbing and not.
_HARDLY_MOVED_M = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Immutable; safe to share by threads. `multipliers` has shape (2, level) for x and y at `LEVELS`.

    `lowest_spread` is None in bands that were stored before the lowest x counted: there it does not.

    `coverage` says what was measured on left-out runs, as JSON values; it changes no answer.
    """

    neighbourhood: Neighbourhood
    reach_time_s: float
    reach_spread: float
    lowest_spread: float | None
    time_s: Array
    scale: ErrorScale
    multipliers: Array
    coverage: Mapping[str, Any]

    @classmethod
    def calibrate(cls, runs: Sequence[ObservedRun], left_out: Mapping[str, Positions], domain: Domain) -> Self:
        """The band of a model from its predictions of each run without that run; `domain` is that of these runs.

        Raises ValueError for fewer than three runs, for a domain without runs and for predictions that do not fit.
        """
        neighbourhood = _known(domain)
        if len(runs) < FEWEST_RUNS:
            raise ValueError(f"a band needs at least {FEWEST_RUNS} runs, got {len(runs)}")
        errors = LeftOutErrors.of(runs, left_out)
        spread, back = _spread(errors.reach_m), _spread(errors.lowest_m)
        places = _places(neighbourhood, errors.scenarios, (errors.reach_m, spread), (errors.lowest_m, back))
        scale = ErrorScale.of(places, errors.envelope_m)
        return cls(
            neighbourhood=neighbourhood,
            reach_time_s=errors.reach_time_s,
            reach_spread=spread,
            lowest_spread=back,
            time_s=errors.time_s,
            scale=scale,
            multipliers=_multipliers(errors.error_m, scale),
            coverage=_coverage(errors.error_m, scale, [float(run.x_m[-1]) for run in runs]),
        )

    @property
    def look_s(self) -> Array:
        """The times (s) at which the band wants to see the predicted x, shape (look,); the last is `reach_time_s`."""
        return np.array([self.reach_time_s]) if self.lowest_spread is None else look_times(self.reach_time_s)

    def half_widths(self, scenarios: Scenarios, time_s: Array, level: float, seen_m: Array) -> tuple[Array, Array]:
        """Half-widths (m) in x and y, each of shape (scenario, time); zero or more, never shrinking with time or level.

        `time_s` is of shape (time,) or (scenario, time), `seen_m` (scenario, look) is the x that the model predicts
        for `look_s`. Raises InvalidValueError for a level that is not 0.5 to 0.99.
        """
        if not LOWEST_LEVEL <= level <= HIGHEST_LEVEL:
            raise InvalidValueError("band_level", level, f"{LOWEST_LEVEL:g} to {HIGHEST_LEVEL:g}")
        ways = [(seen_m[:, -1], self.reach_spread)]
        if self.lowest_spread is not None:
            ways.append((np.minimum(seen_m.min(axis=1), 0.0), self.lowest_spread))
        places = _places(self.neighbourhood, scenarios, *ways)
        factors = [np.interp(level, LEVELS, multipliers) for multipliers in self.multipliers]
        halves = np.empty((2, len(places), time_s.shape[-1]))
        for rows in chunks(len(places), len(self.scale.places) + len(self.time_s)):
            times = time_s if time_s.ndim == 1 else time_s[rows]
            for half, factor, curves in zip(halves, factors, self.scale.at(places[rows]), strict=True):
                half[rows] = self._at_times(factor * curves, times)
        return halves[0], halves[1]

    def edges(
        self,
        _model: TrajectoryModel,
        scenarios: Scenarios,
        time_s: Array,
        level: float,
        centre: Positions,
        seen_m: Array,
    ) -> Edges:
        """The band around `centre`, what the model says at `time_s`; as `half_widths` has it."""
        half_x, half_y = self.half_widths(scenarios, time_s, level, seen_m)
        x, y = centre.x_m, centre.y_m
        return Edges(x - half_x, x + half_x, y - half_y, y + half_y)

    def _at_times(self, curves: Array, time_s: Array) -> Array:
        """Curves (scenario, grid) at other times, going on linearly beyond the grid."""
        horizon = self.time_s[-1]
        inside = interpolate_curves(time_s, self.time_s, curves)
        if not (time_s > horizon).any():
            return inside
        last_part = np.array([1.0 - _LAST_PART, 1.0]) * horizon
        before, last = interpolate_curves(last_part, self.time_s, curves).T
        rate = np.maximum(last / horizon, (last - before) / (_LAST_PART * horizon))[:, None]
        return np.asarray(inside + rate * np.maximum(time_s - horizon, 0.0))

    def describe(self) -> dict[str, Any]:
        """Settings, quantiles and measured coverage as JSON values."""
        return {
            "method": "cross-conformal over left-out runs, pointwise in time",
            "levels": list(LEVELS),
            "multipliers": {"x_m": self.multipliers[0].tolist(), "y_m": self.multipliers[1].tolist()},
            "reach_time_s": self.reach_time_s,
            "reach_spread": self.reach_spread,
            "lowest_spread": self.lowest_spread,
            "spacing": self.scale.spacing,
            "coverage": dict(self.coverage),
        }

    def tensors(self) -> dict[str, Array]:
        """What is too long for JSON: the runs' places and their error curves."""
        x_envelope, y_envelope = self.scale.envelope_m
        tensors = {"places": self.scale.places, "x_envelope_m": x_envelope, "y_envelope_m": y_envelope}
        # safetensors writes memory as it lies
        return {name: np.ascontiguousarray(each) for name, each in (tensors | {"time_s": self.time_s}).items()}

    @classmethod
    def restore(cls, description: Mapping[str, Any], tensors: Mapping[str, Array], domain: Domain) -> Self:
        """Inverse of `describe` and `tensors`. Raises CheckpointError for parts that do not fit or are not finite."""
        try:
            return cls._restored(description, tensors, _known(domain))
        except (KeyError, TypeError, ValueError) as error:
            missing = isinstance(error, KeyError) and error.args
            reason = f"{error.args[0]!r} is missing" if missing else str(error)
            raise CheckpointError(f"the band does not fit: {reason}") from error

    @classmethod
    def read(cls, description: Mapping[str, Any], content: bytes, domain: Domain) -> Self:
        """`restore` from the bytes of `BAND_FILE`, the tensors as safetensors; raises CheckpointError."""
        return cls.restore(description, read_weights(safetensors.numpy.load, content, "band"), domain)

    @classmethod
    def _restored(cls, description: Mapping[str, Any], tensors: Mapping[str, Array], known: Neighbourhood) -> Self:
        if tuple(description["levels"]) != LEVELS:
            raise ValueError(f"levels are {description['levels']}, allowed is {list(LEVELS)}")
        multipliers = np.array([description["multipliers"][axis] for axis in ("x_m", "y_m")], dtype=np.float64)
        time, places = _tensor(tensors, "time_s", 1), _tensor(tensors, "places", 2)
        envelope = np.stack([_tensor(tensors, name, 2) for name in ("x_envelope_m", "y_envelope_m")])
        numbers = [float(description[name]) for name in ("reach_time_s", "reach_spread", "spacing")]
        back = description.get("lowest_spread")
        spreads = [numbers[1]] if back is None else [numbers[1], float(back)]
        if multipliers.shape != (2, len(LEVELS)) or envelope.shape != (2, len(places), len(time)):
            raise ValueError(f"multipliers {multipliers.shape}, places {places.shape}, envelopes {envelope.shape}")
        if len(time) < 2 or len(places) < FEWEST_RUNS - 1 or places.shape[1] != known.places.shape[1] + len(spreads):
            raise ValueError(f"time_s has {len(time)} values and places is {places.shape}")
        if not (np.isfinite(multipliers).all() and all(0.0 < each < np.inf for each in numbers + spreads)):
            raise ValueError("multipliers, reach_time_s, spreads and spacing must be finite, the latter positive")
        if min(multipliers.min(), envelope.min()) < 0.0 or time[0] != 0.0 or (np.diff(time) <= 0.0).any():
            raise ValueError("multipliers and envelopes must not be negative, times must rise from zero")
        if (np.diff(multipliers) < 0.0).any() or (np.diff(envelope) < 0.0).any():
            raise ValueError("multipliers and envelopes must not fall")
        scale = ErrorScale(places, envelope, numbers[2])
        lowest_spread = None if back is None else spreads[1]
        coverage = dict(description["coverage"])
        return cls(known, numbers[0], numbers[1], lowest_spread, time, scale, multipliers, coverage)


def _known(domain: Domain) -> Neighbourhood:
    if domain.neighbourhood is None:
        raise ValueError("a band needs a domain that knows its training runs")
    return domain.neighbourhood


def _tensor(tensors: Mapping[str, Array], name: str, dimensions: int) -> Array:
    found = tensors[name]
    if found.dtype != np.float64 or found.ndim != dimensions or not np.isfinite(found).all():
        raise ValueError(
            f"{name} is {found.dtype} {found.shape}, allowed are {dimensions} dimensions of finite float64"
        )
    return found


def _compressed(reach_m: Array) -> Array:
    return np.asarray(np.arcsinh(reach_m / _HARDLY_MOVED_M), dtype=np.float64)


def _spread(way_m: Array) -> float:
    """Of compressed ways, shape (run,). Runs that are all sent alike have none: then a tenth stands for it."""
    return max(float(_compressed(way_m).std()), 0.1)


def _places(neighbourhood: Neighbourhood, scenarios: Scenarios, *ways: tuple[Array, float]) -> Array:
    """Coordinates of scenarios; then of each way (m) of shape (scenario,), compressed, in units of its spread."""
    compressed = [_compressed(way_m) / spread for way_m, spread in ways]
    return np.column_stack([neighbourhood.coordinates(scenarios), *compressed])


def _multipliers(error_m: Array, scale: ErrorScale) -> Array:
    """Quantiles of the scores at `LEVELS`, shape (2, level). Beyond t = 0, where x and its scale are zero."""
    scores = error_m[:, :, 1:] / scale.left_out()[:, :, 1:]
    runs = scores.shape[1]
    # The new run is one more among them (n + 1 of n); with few runs a high level cannot be had and gets the maximum.
    levels = np.minimum(np.array(LEVELS) * (runs + 1) / runs, 1.0)
    return np.stack([_quantiles(each, levels) for each in scores])


def _quantiles(scores: Array, levels: Array) -> Array:
    known = np.isfinite(scores)
    weights = np.broadcast_to(1.0 / np.maximum(known.sum(axis=1, keepdims=True), 1), scores.shape)
    found = np.quantile(scores[known], levels, weights=weights[known], method="inverted_cdf")
    return np.maximum.accumulate(np.asarray(found, dtype=np.float64))


def _coverage(error_m: Array, scale: ErrorScale, final_x_m: Sequence[float]) -> dict[str, Any]:
    """How often bands made without a run hold it, at the usual level: nothing of the run is in its band."""
    at = LEVELS.index(USUAL_LEVEL)
    inside, width = np.empty((2, 2, len(final_x_m)))
    for run in range(len(final_x_m)):
        others = scale.without(run)
        multipliers = _multipliers(np.delete(error_m, run, axis=1), others)[:, at]
        half = multipliers[:, None] * others.at(scale.places[run : run + 1])[:, 0]
        known = np.isfinite(error_m[0, run])
        known[0] = False
        inside[:, run] = (error_m[:, run] <= half)[:, known].mean(axis=1)
        width[:, run] = half[:, known].mean(axis=1)
    climbing = np.array(final_x_m) > _HARDLY_MOVED_M
    measured = {"level": USUAL_LEVEL, "runs": len(final_x_m), "climbing_runs": int(climbing.sum())}
    sides = zip(("x", "y"), inside, width, strict=True)
    return measured | {axis: _measured(shares, widths, climbing) for axis, shares, widths in sides}


def _measured(shares: Array, widths: Array, climbing: npt.NDArray[np.bool_]) -> dict[str, Any]:
    quantiles = {f"p{share:02d}": float(np.quantile(shares, share / 100)) for share in (5, 10, 25, 50)}
    measured = {"coverage": float(shares.mean()), "by_run": quantiles, "mean_half_width_m": float(widths.mean())}
    if climbing.any():
        measured["climbing_coverage"] = float(shares[climbing].mean())
        measured["climbing_mean_half_width_m"] = float(widths[climbing].mean())
        measured["climbing_median_half_width_m"] = float(np.median(widths[climbing]))
    return measured
