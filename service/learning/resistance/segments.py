"""From a recorded run to segments: means of speed, travel and height over times in which little changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from service.learning.observed import ObservedRun
from service.physics.scenario import Array

STEP_S = 1e-3  # runs are resampled to this step
_SMOOTHING_S = 0.04  # of speeds: removes the wheels' lugs, keeps the release
_START_S = 0.02  # the speed at release is the mean over this time


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """One run in pieces; arrays of shape (segment,). `speed_change_m_s` is between the segments' ends."""

    duration_s: Array
    time_s: Array
    travel_m: Array
    speed_m_s: Array
    speed_change_m_s: Array
    height_m: Array
    start_speed_m_s: float
    start_height_m: float


def segments_of(run: ObservedRun) -> Segments:
    """Cuts a run into segments. Raises ValueError for a run that is shorter than a tenth of a second."""
    count = round(run.horizon_s / STEP_S) + 1
    if count < 100:
        raise ValueError(f"run {run.name} lasts {run.horizon_s} s, it must last 0.1 s at least")
    time: Array = np.arange(count) * np.float64(STEP_S)
    travel = np.interp(time, run.time_s, run.x_m) - run.x_m[0]
    height = np.interp(time, run.time_s, run.y_m)
    speed = gaussian_filter1d(np.gradient(travel, STEP_S), _SMOOTHING_S / STEP_S, mode="nearest")
    start_speed = float(np.gradient(travel[: int(_START_S / STEP_S)], STEP_S).mean())
    knots = _knots(time, travel, speed)
    ends = speed[knots]
    ends[0] = start_speed
    area = np.concatenate([[0.0], np.cumsum((height[1:] + height[:-1]) * 0.5 * STEP_S)])
    duration = np.diff(time[knots])
    return Segments(
        duration_s=duration,
        time_s=(time[knots][1:] + time[knots][:-1]) * 0.5,
        travel_m=travel[(knots[1:] + knots[:-1]) // 2],
        speed_m_s=np.diff(travel[knots]) / duration,
        speed_change_m_s=np.diff(ends),
        height_m=np.diff(area[knots]) / duration,
        start_speed_m_s=start_speed,
        start_height_m=float(run.y_m[0]),
    )


def _knots(time: Array, travel: Array, speed: Array) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    knots, at, last = [0], 0, len(time) - 1
    while at < last:
        duration = _duration_s(float(time[at]), float(travel[at]), abs(float(speed[at])))
        following = min(last, at + max(1, round(duration / STEP_S)))
        if last - following < 0.5 * duration / STEP_S:
            following = last
        knots.append(following)
        at = following
    return np.array(knots, dtype=np.intp)


def _duration_s(time_s: float, travel_m: float, speed_m_s: float) -> float:
    """Short at the release and where the rear wheels enter the ruts, long where nothing changes."""
    if time_s < 0.35:
        return 0.05
    if speed_m_s < 0.02 and time_s > 1.5:
        return 0.5
    if travel_m < -0.3:
        return 0.3
    if travel_m > 2.2:
        return 0.6
    if travel_m > 1.5:
        return 0.25
    if -0.1 < travel_m < 0.1:
        length = 0.02
    elif travel_m < 0.2:
        length = 0.04
    else:
        length = 0.045 if 0.98 < travel_m < 1.5 else 0.09
    return min(max(length / max(speed_m_s, 1e-3), 0.07), 0.3)
