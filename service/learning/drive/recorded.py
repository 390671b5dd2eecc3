"""What a recorded run tells of its inputs: the track under it, the controls over time, the speed at release."""

from __future__ import annotations

import numpy as np

from service.learning.drive.inputs import Controls, Track
from service.learning.observed import ObservedRun
from service.physics.parameters import RoverParameters

_START_S = 0.02  # the speed at release is the mean over this time
_KNOT_M = 0.01  # of a track that is read off a run


def track_of(run: ObservedRun, rover: RoverParameters) -> Track:
    """The slope along a run's way, as it was under the rover's middle, half a wheelbase ahead of the rear wheel.

    Where a run came by several times, the slopes met there are averaged.
    """
    if run.controls.slope_angle_rad is None:
        return Track.constant(float(run.scenario.slope_angle_rad[0]))
    middle = run.x_m - run.x_m[0] + 0.5 * rover.wheelbase_m
    cells, place = np.unique(np.round(middle / _KNOT_M), return_inverse=True)
    slopes = np.bincount(place, run.controls.slope_angle_rad) / np.bincount(place)
    return Track(cells * _KNOT_M, slopes)


def controls_of(run: ObservedRun) -> Controls:
    """Torque and brake from each time on at which one of them changes."""
    torque, brake = run.torques_nm, run.brakes
    changes = np.flatnonzero((np.diff(torque) != 0) | (np.diff(brake.astype(int)) != 0)) + 1
    first = np.concatenate([[0], changes])
    times = run.time_s[first].copy()
    times[0] = 0.0
    return Controls(times, np.where(brake[first], 0.0, torque[first]), brake[first])


def start_speed(run: ObservedRun) -> float:
    """Speed (m/s) at release: the parked rover creeps. Of the body if it was recorded: wheels start with a jerk."""
    if run.body_speed_m_s is not None:
        return float(run.body_speed_m_s[0])
    early = run.time_s <= run.time_s[0] + _START_S
    early[:2] = True
    return float(np.polyfit(run.time_s[early], run.x_m[early], 1)[0])
