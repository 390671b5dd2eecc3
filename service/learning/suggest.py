"""Which scenarios to simulate next: a batch that lowers the expected error over the whole domain the most.

A scenario is a point of the domain's neighbourhood: scaled slope, logarithms of torque ratio and mass. How much the
runs leave open there is the posterior variance C of a Gaussian process with unit variance and Matern-5/2 correlation
over the distance between points. A run's left-out error divided by the standard deviation that the *other* runs leave
open at it is the error per unit of ignorance; its geometric mean over the nearby runs, weighted by a Gaussian kernel,
is the local scale s: errors span 1 mm to metres, and an arithmetic mean would be that of the worst run. Then s sqrt(C)
is the error to expect: large where runs are far and where nearby ones were predicted badly, as they are around the
threshold between climbing and sliding.

Suggestions are picked one by one. Each is the candidate that lowers the mean of s sqrt(C) over all candidates the most
once it is simulated: C <- C - C_j C_j' / (C_jj + nugget). So a batch spreads by itself, its first n members do not
depend on its size, and nothing is drawn at random. Without left-out errors s is 1: the batch fills the largest gaps.

Where the version knows the errors of its force balance, a candidate is worth the error to expect of it times the
entropy of the outcome, less where it is near to one that was picked: then metres of sliding, of which there are many
whatever one simulates, do not count, and the threshold does. What the runs leave open has no part in that: the error to
expect grows away from them by itself. A model of the first 80 runs was asked about the 36 of `stall`, `threshold` and
`edge`: that worth ranks its relative errors there with a correlation of 0.83, multiplied with sqrt(C) of 0.61.

Empirical: the two lengths below. On the left-out errors of the 80 shipped Chrono runs, each predicted from the others,
they give a rank correlation of 0.66 between expected and found error; the distance to the runs alone gives 0.26.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.neighbourhood import Neighbourhood
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import torque_ratio

Flags = npt.NDArray[np.bool_]

MOST_SUGGESTIONS = 64
MOST_RUNS = 2000  # keeps the matrices below 100 MB
SMALLEST_DISTANCE = 0.2  # closer to a run or to another suggestion teaches too little; the shipped runs are 0.5 apart
_CORRELATION_LENGTH = 2.5
_SCALE_LENGTH = 0.5
_ERROR_FLOOR_M = 0.003  # no error is smaller than that for sure: two almost equal Chrono runs end 2 to 9 mm apart
_NUGGET = 1e-4  # of the unit variance
_FAR_WEIGHT = 1e-3  # of each run wherever it is, so that far from all runs the scale is their mean
_CANDIDATES = 1024
# Roberts' additive recurrence: multiples of powers of 1/g, g**4 = g + 1, fill the cube evenly and never repeat.
_STEPS: Array = np.power(1.2207440846057596, -np.arange(1.0, 4.0))
_DECIMALS = {"slope_deg": 2, "mass_kg": 1, "torque_nm": 1}  # as in the shipped run tables: 28.16 deg, 597.7 kg


@dataclass(frozen=True, slots=True)
class SuggestedRun:
    """A run to make. `expected_error_m` is None without left-out errors; `distance` is that to `nearest_run`."""

    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float
    expected_error_m: float | None
    distance: float
    nearest_run: str


def suggest_runs(
    known: Neighbourhood,
    spans: Mapping[str, tuple[float, float]],
    count: int,
    unsure: Callable[[Scenarios], Array] | None = None,
) -> tuple[SuggestedRun, ...]:
    """`count` scenarios beside the known runs, the most useful first.

    `unsure` says what scenarios are worth, (scenario,), in any unit, zero for those that shall not be suggested;
    without it gaps and left-out errors do. `spans` bounds slope_deg, mass_kg, torque_nm and torque_ratio; the longest
    horizon_s in it is that of every suggestion. Raises InvalidValueError for a count outside 1 to 64, for more than
    2000 known runs, and when these leave too few gaps.
    """
    if not 1 <= count <= MOST_SUGGESTIONS:
        raise InvalidValueError("n", count, f"1 to {MOST_SUGGESTIONS}")
    if len(known.runs) > MOST_RUNS:
        raise InvalidValueError("runs", len(known.runs), f"at most {MOST_RUNS} known runs")
    candidates = _candidates(known, spans)
    points, distances = known.coordinates(candidates), known.distances(candidates)
    nearest = distances.argmin(axis=1)
    scale = _error_scale(known, points)
    free = distances.min(axis=1) >= SMALLEST_DISTANCE
    if unsure is None:
        by_errors = np.ones(len(points)) if scale is None else scale
        picks = _picks(points, known.places, by_errors, free, count)
    else:
        picks = _worthiest(points, known.places, np.where(free, unsure(candidates), 0.0), count)
    slopes_deg = np.degrees(candidates.slope_angle_rad)
    return tuple(
        SuggestedRun(
            slope_deg=round(float(slopes_deg[index]), 6),  # what the detour over radians added goes
            mass_kg=float(candidates.mass_kg[index]),
            torque_nm=float(candidates.torque_nm[index]),
            horizon_s=spans["horizon_s"][1],
            expected_error_m=None if scale is None else float(scale[index] * deviation),
            distance=float(distances[index, nearest[index]]),
            nearest_run=known.runs[nearest[index]].run,
        )
        for index, deviation in picks
    )


def _picks(points: Array, places: Array, scale: Array, free: Flags, count: int) -> list[tuple[int, float]]:
    """Candidates in the order of their use, each with the standard deviation open there when it was picked."""
    covariance = _posterior(points, places)
    picks: list[tuple[int, float]] = []
    for _ in range(count):
        if not free.any():
            raise InvalidValueError("n", count, f"at most {len(picks)}: closer runs would teach too little")
        variance = covariance.diagonal().clip(min=0.0)
        left = variance - covariance**2 / (variance + _NUGGET)[:, None]  # row: candidate picked, column: where
        expected = np.sqrt(left.clip(min=0.0)) @ scale
        best = int(np.where(free, expected, np.inf).argmin())
        picks.append((best, float(np.sqrt(variance[best]))))
        covariance = covariance - np.outer(covariance[best], covariance[best]) / (variance[best] + _NUGGET)
        free = free & (_distances(points, points[best : best + 1])[:, 0] >= SMALLEST_DISTANCE)
    return picks


def _worthiest(points: Array, places: Array, worth: Array, count: int) -> list[tuple[int, float]]:
    """Candidates in the order of their worth, which falls near to those picked; with the deviation that runs leave."""
    deviation = np.sqrt(_posterior(points, places).diagonal().clip(min=0.0))
    picks: list[tuple[int, float]] = []
    for _ in range(count):
        best = int(worth.argmax())
        if not worth[best] > 0.0:
            raise InvalidValueError("n", count, f"at most {len(picks)}: other runs would teach too little")
        picks.append((best, float(deviation[best])))
        apart = _distances(points, points[[best]])[:, 0]
        worth = np.where(apart < SMALLEST_DISTANCE, 0.0, worth * -np.expm1(-0.5 * apart**2))
    return picks


def _posterior(points: Array, places: Array) -> Array:
    """Covariance that the runs leave open between candidates, shape (candidate, candidate)."""
    half = np.linalg.solve(np.linalg.cholesky(_known_correlation(places)), _correlation(places, points))
    return np.asarray(_correlation(points, points) - half.T @ half)


def _error_scale(known: Neighbourhood, points: Array) -> Array | None:
    """The local error per unit of ignorance at each candidate (m), or None when no run has a left-out error."""
    errors = {at: run.left_out_final_error_m for at, run in enumerate(known.runs)}
    measured = {at: error for at, error in errors.items() if error is not None}
    if not measured:
        return None
    # leave-one-out variance of a Gaussian process: 1 / diagonal of the inverse (Rasmussen & Williams 2006, eq. 5.12)
    left_out = np.sqrt(1.0 / np.linalg.inv(_known_correlation(known.places)).diagonal())[list(measured)]
    logarithms = np.log((np.array(list(measured.values())) + _ERROR_FLOOR_M) / left_out)
    weights = np.exp(-0.5 * (_distances(points, known.places[list(measured)]) / _SCALE_LENGTH) ** 2) + _FAR_WEIGHT
    return np.asarray(np.exp(weights @ logarithms / weights.sum(axis=1)))


def _known_correlation(places: Array) -> Array:
    return np.asarray(_correlation(places, places) + _NUGGET * np.eye(len(places)))


def _correlation(one: Array, other: Array) -> Array:
    """Matern-5/2 (Rasmussen & Williams 2006, eq. 4.17), shape (one, other)."""
    ratio = np.sqrt(5.0) * _distances(one, other) / _CORRELATION_LENGTH
    return np.asarray((1.0 + ratio + ratio**2 / 3.0) * np.exp(-ratio))


def _distances(one: Array, other: Array) -> Array:
    return np.asarray(np.linalg.norm(one[:, None, :] - other[None, :, :], axis=-1))


def _candidates(known: Neighbourhood, spans: Mapping[str, tuple[float, float]]) -> Scenarios:
    """Scenarios evenly over the spans, with rounded values.

    Raises InvalidValueError when rounding leaves none inside.
    """
    lowest, highest = np.array([spans[field] for field in _DECIMALS]).T
    cube = np.mod(0.5 + np.arange(1, _CANDIDATES + 1)[:, None] * _STEPS, 1.0)
    columns = lowest + cube * (highest - lowest)
    columns = np.stack([columns[:, axis].round(digits) for axis, digits in enumerate(_DECIMALS.values())], axis=1)
    columns = np.where(lowest == highest, lowest, columns)
    ratios = torque_ratio(known.rover, known.regolith, _scenarios(columns))
    lowest_ratio, highest_ratio = spans["torque_ratio"]
    inside = ((lowest <= columns) & (columns <= highest)).all(axis=1)
    inside &= (lowest_ratio <= ratios) & (ratios <= highest_ratio)
    if not inside.any():
        raise InvalidValueError("spans", dict(spans), "ranges with room for rounded scenarios")
    return _scenarios(columns[inside])


def _scenarios(columns: Array) -> Scenarios:
    return Scenarios(np.radians(columns[:, 0]), columns[:, 1], columns[:, 2])
