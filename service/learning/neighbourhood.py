"""How far a scenario is from the training runs in slope, torque ratio and mass together, and which are nearest."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from ctypes import addressof, c_double
from dataclasses import asdict, astuple, dataclass, field
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from service.learning.drive.library import address, contiguous, library
from service.learning.observed import ObservedRun
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array, Scenarios
from service.physics.similarity import Numbers, torque_ratio, torque_ratio_of

# Slope counts as it is, the others by their logarithm: 10 % more mass is as much at 300 kg as at 900 kg.
COORDINATES = ("slope_deg", "log_torque_ratio", "log_mass_kg")
# A coordinate is scaled by its spread over the runs, at least by this: a set of one mass has no spread, and yet
# a mass 10 % off is near.
_SMALLEST_SCALE = (2.0, 0.1, 0.1)
_SMALLEST_TORQUE_RATIO = (
    1e-3  # under a thousandth of the weight: the motors are as good as off, and zero has no logarithm
)
_LIMIT_QUANTILE = 0.99
_SMALLEST_LIMIT = 1e-6  # degrees made radians and back must not put a lone run outside itself
NEAREST = 3
MAX_RUNS = 100_000
_CELLS_AT_ONCE = 1_000_000
_Found = c_double * (2 * NEAREST)
FEW = 32  # times fewer cells at once: what fits the processor's caches is made much sooner


@dataclass(unsafe_hash=True, slots=True)
class TrainingRun:
    """One run that a version was trained on; the error is that of its end when it was left out, None if not known.

    Nobody changes one. It is not frozen: to make a frozen one takes three times as long, and each answer has some.
    """

    run: str
    slope_deg: float
    mass_kg: float
    torque_nm: float
    left_out_final_error_m: float | None


@dataclass(unsafe_hash=True, slots=True)
class NearestRun(TrainingRun):
    """A training run and its scaled distance to a scenario."""

    distance: float


@dataclass(frozen=True, slots=True, eq=False)
class Neighbourhood:
    """Training runs as points. `scales` divide the coordinates; `limit` bounds distances seen between runs.

    Raises ValueError for no runs, for runs that cannot be and for scales or a limit that make no distance.
    """

    runs: tuple[TrainingRun, ...]
    scales: tuple[float, ...]
    limit: float
    rover: RoverParameters
    regolith: RegolithParameters
    places: Array = field(init=False)
    _values: tuple[tuple[Any, ...], ...] = field(init=False, repr=False)
    _columns: Array = field(init=False, repr=False)  # `places` as the engine reads them, (3, run)
    _columns_at: int = field(init=False, repr=False)
    _scale: Array = field(init=False, repr=False)
    _points: Points = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 1 <= len(self.runs) <= MAX_RUNS:
            raise ValueError(f"the domain has {len(self.runs)} runs, allowed is 1 to {MAX_RUNS}")
        if len(self.scales) != len(COORDINATES) or not all(np.isfinite(each) and each > 0 for each in self.scales):
            raise ValueError(f"the domain's scales are {self.scales}, allowed are {len(COORDINATES)} positive numbers")
        if not (np.isfinite(self.limit) and self.limit >= 0):
            raise ValueError(f"the domain's joint_limit is {self.limit}, allowed is zero or more")
        errors = [run.left_out_final_error_m for run in self.runs if run.left_out_final_error_m is not None]
        if not all(np.isfinite(error) and error >= 0 for error in errors):
            raise ValueError("the domain's runs have a left_out_final_error_m that is no distance")
        object.__setattr__(self, "_values", tuple(map(astuple, self.runs)))
        object.__setattr__(self, "_scale", np.array(self.scales))
        object.__setattr__(self, "places", self.coordinates(_scenarios(self.runs)))
        object.__setattr__(self, "_columns", contiguous(self.places.T))
        object.__setattr__(self, "_columns_at", address(self._columns))
        object.__setattr__(self, "_points", Points.of(self.places))

    @classmethod
    def of_runs(
        cls,
        runs: Sequence[ObservedRun],
        rover: RoverParameters,
        regolith: RegolithParameters,
        left_out_errors_m: Mapping[str, float] | None = None,
    ) -> Self:
        """The neighbourhood of these runs.

        The limit is the 99 % quantile of each run's distance to the nearest other one: what leaving a run out shows.
        """
        errors = left_out_errors_m or {}
        points = tuple(
            TrainingRun(run.name, run.slope_deg, run.mass_kg, run.torque_nm, errors.get(run.name)) for run in runs
        )
        every = _scenarios(points)
        ratio = torque_ratio(rover, regolith, every)
        spread = _raw(np.degrees(every.slope_angle_rad), ratio, every.mass_kg).std(axis=0)
        scales = tuple(float(scale) for scale in np.maximum(spread, _SMALLEST_SCALE))
        whole = cls(points, scales, 0.0, rover, regolith)
        gaps = nearest_other(whole.places)
        limit = float(np.quantile(gaps, _LIMIT_QUANTILE)) if len(gaps) else 0.0
        return cls(points, scales, max(limit, _SMALLEST_LIMIT), rover, regolith)

    def coordinates(self, scenarios: Scenarios) -> Array:
        """Scaled coordinates of scenarios, shape (scenario, 3): their Euclidean distance is the joint distance."""
        return self.places_of(np.degrees(scenarios.slope_angle_rad), scenarios.mass_kg, scenarios.torque_nm)

    def places_of(self, slope_deg: Numbers, mass_kg: Numbers, torque_nm: Numbers) -> Array:
        """The same by the inputs: shape (scenario, 3), of single numbers (3,)."""
        ratio = torque_ratio_of(self.rover, self.regolith, mass_kg, torque_nm)
        return _raw(slope_deg, ratio, mass_kg) / self._scale

    def distances(self, scenarios: Scenarios) -> Array:
        """Distance of each scenario to each run, shape (scenario, run)."""
        return np.asarray(np.linalg.norm(self.coordinates(scenarios)[:, None] - self.places, axis=2), dtype=np.float64)

    def nearest_to(self, place: tuple[float, float, float]) -> tuple[NearestRun, ...]:
        """The runs nearest to one place, three numbers, nearest first; of equals the first one."""
        wanted, found = min(NEAREST, len(self.runs)), _Found()
        library().rover_nearest(len(self.runs), self._columns_at, *place, wanted, addressof(found))
        told: list[float] = found[: 2 * wanted]
        return tuple(map(self._near, map(int, told[::2]), map(math.sqrt, told[1::2])))

    def nearest_many(self, places: Array, count: int = NEAREST) -> tuple[npt.NDArray[np.intp], Array]:
        """Which runs are nearest to each place (scenario, 3), and their distances: both (scenario, up to `count`).

        Nearest first. The distances of a chunk of places to all runs are in memory at once.
        """
        kept = min(count, len(self.runs))
        order, found = np.empty((len(places), kept), dtype=np.intp), np.empty((len(places), kept))
        for rows in chunks(len(places), len(self.runs)):
            gaps = places[rows, None] - self.places
            squares = np.einsum("ijk,ijk->ij", gaps, gaps)
            every = np.arange(len(squares))
            for at in range(kept):  # the first of equals each time: as a stable sort would have it
                order[rows, at] = nearest = squares.argmin(axis=1)
                found[rows, at] = squares[every, nearest]
                squares[every, nearest] = np.inf
        return order, np.sqrt(found, out=found)

    def least_distances(self, places: Array) -> Array:
        """How far the nearest run is from each place (scenario, 3); shape (scenario,). Much faster than which it is."""
        found = np.empty(len(places))
        for rows in chunks(len(places), FEW * len(self.runs)):
            found[rows] = self._points.squared_distances(places[rows]).min(axis=1)
        return np.sqrt(found, out=found)

    def place_of(self, slope_deg: float, mass_kg: float, torque_nm: float) -> tuple[float, float, float]:
        """`places_of` one place, in plain numbers: in a tenth of the time."""
        return self.place_at(slope_deg, mass_kg, torque_ratio_of(self.rover, self.regolith, mass_kg, torque_nm))

    def place_at(self, slope_deg: float, mass_kg: float, ratio: float) -> tuple[float, float, float]:
        """The same by the torque ratio."""
        slope, torque, mass = self.scales
        return slope_deg / slope, math.log(max(ratio, _SMALLEST_TORQUE_RATIO)) / torque, math.log(mass_kg) / mass

    def least_distance(self, slope_deg: float, mass_kg: float, torque_nm: float) -> float:
        """How far the nearest run is from one place, by its inputs."""
        return self._points.least_distance(self.place_of(slope_deg, mass_kg, torque_nm))

    def nearest_runs(self, order: npt.NDArray[np.intp], distances: Array) -> tuple[NearestRun, ...]:
        """One place's row of `nearest_many` as runs."""
        return tuple(map(self._near, order.tolist(), distances.tolist()))

    def _near(self, at: int, distance: float) -> NearestRun:
        run, slope_deg, mass_kg, torque_nm, error_m = self._values[at]
        return NearestRun(run, slope_deg, mass_kg, torque_nm, error_m, distance)

    def describe(self) -> dict[str, Any]:
        """As JSON values."""
        return {
            "runs": [asdict(run) for run in self.runs],
            "scales": dict(zip(COORDINATES, self.scales, strict=True)),
            "joint_limit": self.limit,
        }

    @classmethod
    def restore(cls, description: Mapping[str, Any], rover: RoverParameters, regolith: RegolithParameters) -> Self:
        """Inverse of `describe`. Raises ValueError, KeyError or TypeError for a description that does not fit."""
        runs = tuple(_restored_run(each) for each in description["runs"])
        scales = tuple(float(description["scales"][name]) for name in COORDINATES)
        return cls(runs, scales, float(description["joint_limit"]), rover, regolith)


def chunks(rows: int, columns: int) -> Iterator[slice]:
    """Rows in chunks, such that a table of `columns` columns stays at some eight megabytes of float64."""
    size = max(1, _CELLS_AT_ONCE // max(columns, 1))
    return (slice(first, first + size) for first in range(0, rows, size))


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Places that many others are compared with: what of that is always the same."""

    centre: Array
    doubled: Array  # minus twice their coordinates from the centre, (coordinate, point)
    squares: Array
    _centre: tuple[float, ...]

    @classmethod
    def of(cls, places: Array) -> Self:
        """Of places (point, coordinate)."""
        centre = places.mean(axis=0)
        there = places - centre
        doubled, squares = np.ascontiguousarray(-2.0 * there.T), np.square(there).sum(axis=1)
        return cls(centre, doubled, squares, tuple(centre.tolist()))

    def squared_distances(self, places: Array) -> Array:
        """Of each place (place, coordinate) to each point, (place, point): rounded, as it is one product."""
        here = places - self.centre
        found = np.asarray(here @ self.doubled)
        found += np.einsum("ij,ij->i", here, here)[:, None]
        found += self.squares
        return np.asarray(np.maximum(found, 0.0, out=found))

    def least_distance(self, place: tuple[float, float, float]) -> float:
        """From one place to the nearest point: the root of the least of `squared_distances`."""
        first, second, third = self._centre
        x, y, z = place[0] - first, place[1] - second, place[2] - third
        found = np.array((x, y, z)).dot(self.doubled)
        found += self.squares
        least = found.item(found.argmin()) + (x * x + y * y + z * z)
        return math.sqrt(max(least, 0.0))


def nearest_other(places: Array) -> Array:
    """Distance of each place to the nearest other one, shape (place,); empty for a single place."""
    if len(places) < 2:
        return np.empty(0)
    distances = np.linalg.norm(places[:, None] - places, axis=2)
    np.fill_diagonal(distances, np.inf)
    return np.asarray(distances.min(axis=1), dtype=np.float64)


def _raw(slope_deg: Numbers, ratio: Numbers, mass_kg: Numbers) -> Array:
    """Unscaled coordinates, the last axis."""
    return np.array([slope_deg, np.log(np.maximum(ratio, _SMALLEST_TORQUE_RATIO)), np.log(mass_kg)]).T


def _scenarios(runs: Sequence[TrainingRun]) -> Scenarios:
    return Scenarios(
        np.radians([run.slope_deg for run in runs]),
        np.array([run.mass_kg for run in runs]),
        np.array([run.torque_nm for run in runs]),
    )


def _restored_run(description: Mapping[str, Any]) -> TrainingRun:
    error = description["left_out_final_error_m"]
    return TrainingRun(
        str(description["run"]),
        float(description["slope_deg"]),
        float(description["mass_kg"]),
        float(description["torque_nm"]),
        None if error is None else float(error),
    )
