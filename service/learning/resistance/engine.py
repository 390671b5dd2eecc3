"""A resistance process made ready for the compiled engine: arrays laid out as it reads them, addresses taken once."""

from __future__ import annotations

from collections.abc import Iterable
from ctypes import addressof

import numpy as np
import numpy.typing as npt

from service.learning.resistance.features import compiled_gate
from service.learning.resistance.hyperparameters import Hyperparameters, KernelHyperparameters, Lengths
from service.learning.resistance.kernels import ScenarioFeatures, rut_plateau
from service.learning.resistance.library import (
    LANES,
    Knots,
    Model,
    Process,
    address,
    contiguous,
    first,
    library,
    require_success,
)
from service.learning.resistance.start import INVERSE_LENGTHS, StartProcess
from service.learning.resistance.tables import (
    GRID_KNOTS,
    HEIGHT_STEP_M,
    TRAVEL_GRID_M,
    TRAVEL_KNOTS_M,
    TRAVEL_STEP_M,
    ResponseTables,
)
from service.learning.resistance.traction import TractionCurves, compiled_laws, rut_blend, speed_grid
from service.physics.prior import Prior
from service.physics.scenario import Array

# Up to this time fewer steps are taken than time knots are stored: only knots that steps ask for are evaluated.
_THINNED_S = 10.0
_LINE_BYTES = 64  # of the processor's cache
_EVERY_KNOT = np.arange(len(TRAVEL_KNOTS_M))


class Engine:
    """Predicts with one model. Holds what the compiled code reads, which nobody changes: safe to share by threads."""

    def __init__(
        self,
        prior: Prior,
        hyper: Hyperparameters,
        curves: TractionCurves,
        features: ScenarioFeatures,
        time_knots_s: Array,
        resistance: ResponseTables,
        height: ResponseTables,
        start: StartProcess,
        *,
        refine: int = 1,
    ) -> None:
        """`refine` cuts the steps of the integration, for those who ask whether they are fine enough."""
        self._kept: list[npt.NDArray[np.float64] | npt.NDArray[np.int32]] = []
        self._shapes: dict[Lengths, int] = {}  # kernels of the same lengths have one number
        known = features.scaled
        speeds = self._keep_array(speed_grid(prior.rover))
        _require_shapes(features, time_knots_s, (resistance, height), start)
        ends = step_times(min(float(time_knots_s[-1]), _THINNED_S), refine)
        middles = 0.5 * (ends[:-1] + ends[1:])
        processes = (
            self._process(hyper.resistance, resistance, GRID_KNOTS, TRAVEL_STEP_M, time_knots_s, middles),
            self._process(hyper.height, height, _EVERY_KNOT, HEIGHT_STEP_M, time_knots_s, ends),
        )
        self._model = Model(
            laws=compiled_laws(prior.rover, curves, hyper, speeds),
            stall_gate=compiled_gate(hyper),
            gravity_m_s2=prior.regolith.gravity_m_s2,
            run_count=len(known),
            shape_count=len(self._shapes),
            refine=refine,
            low=tuple(known.min(axis=0)),
            high=tuple(known.max(axis=0)),
            feature_margin=hyper.feature_margin,
            mass_reach=hyper.mass_reach,
            features=self._keep(known.T),
            gate=self._keep(features.gate),
            half_inverse_square=self._keep(0.5 / np.square(list(self._shapes))),
            blend=self._keep(rut_blend(hyper, TRAVEL_GRID_M)),
            start_features=self._keep(start.features.T),
            start_weights=self._keep(start.weights.T),
            start_mean=tuple(start.mean),
            start_inverse_lengths=tuple(INVERSE_LENGTHS),
            resistance=processes[0],
            height=processes[1],
        )
        self._address = addressof(self._model)
        self._predict = library().rover_predict

    def predict(self, angle_rad: Array, mass_kg: Array, torque_ratio: Array, time_s: Array) -> tuple[Array, Array]:
        """x and y (m), shape (scenario, time), for columns (scenario,) and times (time,) or (scenario, time).

        Raises ValueError for shapes that do not fit and times that are not finite, MemoryError for a horizon too long.
        """
        scenarios = np.concatenate((angle_rad, mass_kg, torque_ratio), dtype=np.float64)
        time = contiguous(time_s)
        count, times = len(angle_rad), time.shape[-1]
        if (
            scenarios.shape != (3 * count,)
            or len(mass_kg) != count
            or (time.ndim != 1 and time.shape != (count, times))
        ):
            shapes = [np.shape(each) for each in (angle_rad, mass_kg, torque_ratio, time)]
            raise ValueError(f"shapes {shapes} do not fit: three columns (scenario,), then (time,) or (scenario, time)")
        positions = np.empty((2, count, times))
        if positions.size:
            stride = 0 if time.ndim == 1 else times
            require_success(
                self._predict(self._address, count, first(scenarios), times, first(time), stride, first(positions))
            )
        return positions[0], positions[1]

    def _keep_array(self, array: npt.NDArray[np.float64]) -> Array:
        kept = contiguous(array)
        self._kept.append(kept)
        return kept

    def _keep(self, array: npt.NDArray[np.float64]) -> int:
        """The address of a copy, or of the array itself, that lives as long as this."""
        return address(self._keep_array(array))

    def _process(
        self,
        hyper: KernelHyperparameters,
        tables: ResponseTables,
        knots: npt.NDArray[np.intp],
        step_m: float,
        time_knots_s: Array,
        asked_s: Array,
    ) -> Process:
        """`knots` are those of TRAVEL_KNOTS_M that count; of the time knots only those beside `asked_s` do."""
        times = _knots_beside(time_knots_s, asked_s)
        lengths = hyper.level_lengths, hyper.travel_lengths, hyper.release_lengths, hyper.rut_lengths
        deviations = hyper.level_deviation, hyper.travel_deviation, hyper.release_deviation, hyper.rut_deviation
        return Process(
            shape=tuple(self._shapes.setdefault(each, len(self._shapes)) for each in (*lengths, hyper.stall_lengths)),
            variance=tuple(each**2 for each in (*deviations, hyper.stall_time_deviation)),
            stall_level_variance=hyper.stall_level_deviation**2,
            stall_travel_variance=hyper.stall_travel_deviation**2,
            level_inverse_square=tuple(1.0 / np.square(hyper.level_lengths)),
            travel_inverse_square=tuple(1.0 / np.square(hyper.travel_lengths)),
            level=self._keep(tables.level),
            rut=self._keep(tables.rut),
            travel=self._keep(_blocks(tables.travel[:, knots])),
            plateau=self._keep(_blocks(rut_plateau(TRAVEL_KNOTS_M[knots])[None, :])),
            time=self._keep(_blocks(np.concatenate([tables.release, tables.stall])[:, times])),
            knots=self._knots(TRAVEL_KNOTS_M[knots], step_m),
            time_count=len(times),
            time_s=self._keep(time_knots_s[times]),
            time_inverse=self._keep(1.0 / np.diff(time_knots_s[times])),
        )

    def _knots(self, knots_m: Array, step_m: float) -> Knots:
        """Where knots lie among the cells of a uniform grid, of which they are points."""
        numbers = np.round((knots_m - knots_m[0]) / step_m).astype(np.intp)
        widths = np.diff(numbers)
        knot = np.repeat(np.arange(len(widths), dtype=np.int32), widths)
        self._kept.append(knot)
        return Knots(
            first_m=float(knots_m[0]),
            step_m=step_m,
            cell_count=len(knot),
            knot_count=len(numbers),
            knot=address(knot),
            number=self._keep(numbers.astype(np.float64)),
            inverse=self._keep(1.0 / widths),
        )


def step_times(horizon_s: float, refine: int = 1) -> Array:
    """Times (s) of the integration's steps, from 0 to the horizon or just past it; `refine` cuts each step.

    Raises ValueError for a negative horizon or a `refine` below 1, MemoryError for a horizon too long.
    """
    if refine < 1 or not horizon_s >= 0:
        raise ValueError(f"steps need a horizon of 0 s or more and refine of 1 or more, got {horizon_s} and {refine}")
    count = library().rover_step_times(horizon_s, refine, 0, None)
    if count < 0:
        raise MemoryError(f"a horizon of {horizon_s} s is too long")
    times = np.empty(count)
    library().rover_step_times(horizon_s, refine, count, address(times))
    return times


def _knots_beside(knots_s: Array, asked_s: Array) -> npt.NDArray[np.intp]:
    """The first knot, those that rising times are read between, and all later ones."""
    below = np.clip(np.searchsorted(knots_s, asked_s, side="right") - 1, 0, len(knots_s) - 1)
    above = np.minimum(below + 1, len(knots_s) - 1)
    rest = np.arange(above[-1] if len(above) else 0, len(knots_s))
    return np.unique(np.concatenate([[0], below, above, rest]))


def _require_shapes(
    features: ScenarioFeatures, time_knots_s: Array, processes: Iterable[ResponseTables], start: StartProcess
) -> None:
    """The compiled code trusts these. Raises ValueError for arrays that do not fit each other."""
    runs, knots = len(features.scaled), len(time_knots_s)
    shapes: list[tuple[Array, tuple[int, ...]]] = [(features.scaled, (runs, 3)), (features.gate, (runs,))]
    shapes += [(start.features, (runs, 2)), (start.weights, (runs, 2)), (start.mean, (2,)), (time_knots_s, (knots,))]
    for tables in processes:
        shapes += [(tables.level, (runs,)), (tables.rut, (runs,)), (tables.travel, (runs, len(TRAVEL_KNOTS_M)))]
        shapes += [(tables.release, (runs, knots)), (tables.stall, (runs, knots))]
    if not (runs and knots) or any(array.shape != shape for array, shape in shapes):
        raise ValueError(f"the tables of a resistance process of {runs} runs and {knots} time knots do not fit")


def _blocks(table: Array) -> Array:
    """A table (row, knot) as (block, row, lane), zero past its last knot, each row in cache lines of its own."""
    rows, knots = table.shape
    blocks = -(-knots // LANES)
    room = np.zeros(blocks * rows * LANES + _LINE_BYTES // 8)
    start = -address(room) % _LINE_BYTES // 8
    aligned = room[start : start + blocks * rows * LANES].reshape(blocks, rows, LANES)
    padded = np.zeros((rows, blocks * LANES))
    padded[:, :knots] = table
    aligned[:] = padded.reshape(rows, blocks, LANES).transpose(1, 0, 2)
    return aligned
