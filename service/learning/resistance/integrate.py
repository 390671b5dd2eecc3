"""Solving dv/dt = g [F(v, x) - sin th - rho(x, t)], dx/dt = v step by step.

Exponential Euler: within a step the right-hand side is linearised in v, which is solved exactly, so that the steep rise
of traction with slip sets no limit on the step. Plain numbers in lists: for one scenario that is faster than arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import exp

import numpy as np

from service.learning.resistance.hyperparameters import Hyperparameters
from service.learning.resistance.traction import SpeedLaw, rut_blend
from service.physics.scenario import Array

# Travel (m) on a uniform grid; outside, the resistance is that at the ends.
TRAVEL_STEP_M = 0.01
TRAVEL_GRID_M: Array = np.arange(-500, 801) * np.float64(TRAVEL_STEP_M)
# (step, until), s: the release is fast, and past the training horizon nothing is.
_SCHEDULE = ((0.02, 2.0), (0.05, 10.0), (0.1, float("inf")))
LEAST_RATE = 0.05  # 1/s, of the linearised right-hand side
_SPEED_FACTOR = 1.2  # times the no-load rim speed


@dataclass(frozen=True, slots=True, eq=False)
class Steps:
    """`time_s` has shape (step + 1,), `middle_s` and `duration_s` (step,)."""

    time_s: Array
    middle_s: Array
    duration_s: tuple[float, ...]


@lru_cache(maxsize=16)
def steps_until(horizon_s: float, refine: int = 1) -> Steps:
    """Steps from 0 to the horizon or just past it. They start the same for every horizon."""
    parts: list[Array] = [np.zeros(1)]
    start = 0.0
    for step, until in _SCHEDULE:
        if start >= horizon_s:
            break
        length = min(until, max(horizon_s, start + step)) - start
        count = int(np.ceil(length * refine / step - 1e-9))
        parts.append(start + np.arange(1, count + 1) * np.float64(step / refine))
        start = until
    time = np.concatenate(parts)
    duration = np.diff(time)
    return Steps(time, time[:-1] + 0.5 * duration, tuple(duration.tolist()))


@lru_cache(maxsize=16)
def rut_blends(hyper: Hyperparameters) -> tuple[float, ...]:
    """`rut_blend` over TRAVEL_GRID_M."""
    return tuple(rut_blend(hyper, TRAVEL_GRID_M).tolist())


def speed_bounds(speeds_m_s: Array, gravity_m_s2: float, steps: Steps) -> list[float]:
    """What the speed (m/s) must not pass at the end of each step; `speeds_m_s` are those of the law."""
    # Half of the grid's lower end, -2 times it (see traction.speed_grid): the no-load rim speed.
    rim = -0.5 * float(speeds_m_s[0])
    bounds: list[float] = np.maximum(_SPEED_FACTOR * rim, gravity_m_s2 * steps.time_s[1:]).tolist()
    return bounds


def integrate(
    hyper: Hyperparameters,
    law: SpeedLaw,
    gravity_m_s2: float,
    along_travel: Array,
    along_time: Array,
    start_speed_m_s: float,
    steps: Steps,
) -> Array:
    """Travel x (m) at the steps' times, shape (step + 1,), from x = 0.

    `along_travel` is the resistance over TRAVEL_GRID_M, `along_time` what adds to it at the middle of each step. Soil
    and motors do not push a rover that slides back: it gains no more than gravity gives. And the speed stays within
    1.2 times the no-load rim speed, or what free fall gives in the time: a bound, not a model.
    """
    virgin, rut = law.virgin.tolist(), law.rut.tolist()
    resistance, blend = along_travel.tolist(), rut_blends(hyper)
    lowest, per_speed = float(law.speeds_m_s[0]), 1.0 / float(law.speeds_m_s[1] - law.speeds_m_s[0])
    last_speed, last_travel = len(virgin) - 1.000001, len(resistance) - 1.000001
    first_travel, per_travel = float(TRAVEL_GRID_M[0]), 1.0 / TRAVEL_STEP_M
    slope_gain = -gravity_m_s2 * per_speed
    steepest = min(-law.sine, 0.0)
    bounds = speed_bounds(law.speeds_m_s, gravity_m_s2, steps)
    x, v = 0.0, start_speed_m_s
    travelled = [x]
    for dt, release, bound in zip(steps.duration_s, along_time.tolist(), bounds, strict=True):
        place = (x + v * dt * 0.5 - first_travel) * per_travel
        place = 0.0 if place < 0.0 else place if place < last_travel else last_travel
        cell = int(place)
        low = resistance[cell]
        rho = low + (place - cell) * (resistance[cell + 1] - low) + release
        rutted = blend[cell]
        place = (v - lowest) * per_speed
        place = 0.0 if place < 0.0 else place if place < last_speed else last_speed
        cell = int(place)
        push = virgin[cell]
        change = virgin[cell + 1] - push
        push += (place - cell) * change
        if rutted > 0.0:
            other = rut[cell]
            rise = rut[cell + 1] - other
            push += rutted * (other + (place - cell) * rise - push)
            change += rutted * (rise - change)
        rate = slope_gain * change
        if rate < LEAST_RATE:
            rate = LEAST_RATE
        force = push - rho
        if v < 0.0 and force < steepest:
            force = steepest
        gain = gravity_m_s2 * force / rate
        approach = 1.0 - exp(-rate * dt)
        x += v * dt + gain * (dt - approach / rate)
        v += gain * approach
        if not -bound < v < bound:
            v = bound if v > 0.0 else -bound
        travelled.append(x)
    return np.array(travelled)
