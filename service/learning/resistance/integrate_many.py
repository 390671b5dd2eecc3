"""The integration of `service.learning.resistance.integrate` for many scenarios at once, one array over them per step.

The same steps and the same formulas in the same order, so that rounding is all that may differ. It pays from about
sixteen scenarios on: below, the plain numbers of `integrate` are faster than the overhead of arrays.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.integrate import LEAST_RATE, Steps, rut_blends, speed_bounds
from service.learning.resistance.tables import GRID_CELLS
from service.learning.resistance.traction import SpeedLaws
from service.physics.scenario import Array

Index = npt.NDArray[np.intp]


def integrate_many(
    hyper: Hyperparameters,
    laws: SpeedLaws,
    gravity_m_s2: float,
    along_travel: Array,
    along_time: Array,
    start_speed_m_s: Array,
    steps: Steps,
) -> tuple[Array, Index]:
    """Travel x (m) at the steps' times, shape (scenario, step + 1), from x = 0; and whose travel is wrong.

    `along_travel` (scenario, knot) is over TRAVEL_KNOTS_M[GRID_KNOTS], `along_time` (scenario, step) adds to it at the
    middle of each step, `start_speed_m_s` has shape (scenario,). Wrong is that of scenarios whose speed left what
    their law tabulates: they need the whole law.

    Inside, travel is counted in cells of the uniform grid from its first point on, and speed in such cells per second.
    """
    count, speeds, knots = len(laws.margin), laws.virgin.shape[1], along_travel.shape[1]
    virgin, rut, resistance = laws.virgin.ravel(), laws.rut.ravel(), along_travel.ravel()
    blend = np.array(rut_blends(hyper))
    per_travel, per_speed = 1.0 / GRID_CELLS.step_m, 1.0 / float(laws.speeds_m_s[1] - laws.speeds_m_s[0])
    to_speed, lowest = per_speed / per_travel, float(laws.speeds_m_s[0]) * per_speed
    first, last = laws.first.astype(np.float64), laws.last - 0.000001
    knot_starts, speed_starts = np.arange(count) * knots, np.arange(count) * speeds
    slope_gain, push_gain = -gravity_m_s2 * per_speed, gravity_m_s2 * per_travel
    steepest, releases = np.minimum(-laws.sine, 0.0), np.ascontiguousarray(along_time.T)
    bounds = speed_bounds(laws.speeds_m_s, gravity_m_s2, steps)
    v = start_speed_m_s * per_travel
    travelled, started = np.empty((len(bounds) + 1, count)), np.empty((len(bounds), count))
    travelled[0] = x = np.full(count, -GRID_CELLS.first_m * per_travel)
    for at, (dt, bound) in enumerate(zip(steps.duration_s, bounds, strict=True)):
        started[at] = v
        place = v * (dt * 0.5)
        place += x
        rho, rutted = _resistance(place, resistance, knot_starts, blend)
        rho += releases[at]
        place = v * to_speed
        place -= lowest
        np.maximum(place, first, out=place)
        np.minimum(place, last, out=place)
        push, change = _traction(place, virgin, rut, speed_starts, rutted)
        change *= slope_gain
        rate = np.maximum(change, LEAST_RATE, out=change)
        push -= rho
        np.maximum(push, np.where(v < 0.0, steepest, -np.inf), out=push)
        push *= push_gain
        gain = np.divide(push, rate, out=push)
        approach = np.exp(rate * -dt)
        np.subtract(1.0, approach, out=approach)
        np.divide(approach, rate, out=rate)
        np.subtract(dt, rate, out=rate)
        rate *= gain
        rate += v * dt
        x = np.add(x, rate, out=travelled[at + 1])
        approach *= gain
        v = v + approach
        np.minimum(v, bound * per_travel, out=v)
        np.maximum(v, -bound * per_travel, out=v)
    slowest = started.min(axis=0, initial=np.inf) * to_speed - lowest
    fastest = started.max(axis=0, initial=-np.inf) * to_speed - lowest
    left = ((slowest < first) & (laws.first > 0)) | ((fastest > last) & (laws.last < speeds - 1))
    travel = travelled.T * GRID_CELLS.step_m
    travel += GRID_CELLS.first_m
    return travel, np.flatnonzero(left)


def _resistance(place: Array, table: Array, starts: Index, blend: Array) -> tuple[Array, Array]:
    """The resistance at places, in cells of the uniform grid, and how far the ruts count there; overwrites `place`."""
    np.maximum(place, 0.0, out=place)
    np.minimum(place, len(GRID_CELLS.knot) - 0.000001, out=place)
    cell = place.astype(np.intp)
    place -= GRID_CELLS.left.take(cell)
    place *= GRID_CELLS.inverse.take(cell)
    knot = GRID_CELLS.knot.take(cell)
    knot += starts
    rho, _ = _line(table, knot, knot + 1, place)
    return rho, blend.take(cell)


def _traction(place: Array, virgin: Array, rut: Array, starts: Index, rutted: Array) -> tuple[Array, Array]:
    """What the wheels push with at places among the laws' speeds, and its rise to the next; overwrites `place`."""
    cell = place.astype(np.intp)
    place -= cell
    cell += starts
    after = cell + 1
    push, change = _line(virgin, cell, after, place)
    if rutted.any():
        other, rise = _line(rut, cell, after, place)
        other -= push
        rise -= change
        other *= rutted
        rise *= rutted
        push += other
        change += rise
    return push, change


def _line(table: Array, cell: Index, after: Index, fraction: Array) -> tuple[Array, Array]:
    """Values at fractions of flat cells, and the rise from there to the next point."""
    low, rise = table.take(cell), table.take(after)
    rise -= low
    low += fraction * rise
    return low, rise
