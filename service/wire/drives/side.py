"""A drive seen from the side: the ground that it shows, the way over it, where the rover ends, what happens where."""

from __future__ import annotations

import numpy as np

from service.physics.parameters import RoverParameters
from service.physics.scenario import Array
from service.twin.drives import Drive
from service.wire.forms.subject import Side

_PLACES = 400
_BEHIND_M, _AHEAD_M = 0.5, 0.6  # of ground beyond the wheels
_AT_LEAST_M = 3.0  # of track that was asked for and not reached
_MOST_WAY = 400


def side_of(drive: Drive, rover: RoverParameters, most_marks: int) -> Side:
    """What is drawn of it, in the world frame whatever the drive's frame is."""
    along = drive.along_m[0]
    across, up = drive.world_m()
    kept = np.unique(np.linspace(0, len(along) - 1, min(len(along), _MOST_WAY)).round().astype(np.intp))
    places = _places(drive, rover)
    marks = tuple((*_centre(drive, each.x_m), each.event.value.replace("_", " ")) for each in drive.events[:most_marks])
    return Side(
        drive.question.ground.world(places, np.zeros_like(places)),
        (across[kept], up[kept]),
        (_centre(drive, float(along[-1])), _front(drive, rover), rover.wheel_radius_m),
        marks,
    )


def _places(drive: Drive, rover: RoverParameters) -> Array:
    """Distances (m) along the track: where the rover was, and some of what was ahead of it."""
    along = drive.along_m[0]
    lowest, highest = float(along.min()), float(along.max())
    end_m = drive.question.ground.end_m
    more = max(_AT_LEAST_M, 0.5 * (highest - lowest))
    reach = highest if end_m is None else float(np.clip(end_m, highest, highest + more))
    return np.linspace(lowest - _BEHIND_M, max(reach, highest + rover.wheelbase_m) + _AHEAD_M, _PLACES)


def _centre(drive: Drive, distance_m: float) -> tuple[float, float]:
    """The rear wheel's centre when it is at this distance."""
    along, height = drive.along_m
    at = int(np.abs(along - distance_m).argmin())
    return _point(drive, distance_m, float(height[at]))


def _front(drive: Drive, rover: RoverParameters) -> tuple[float, float]:
    along, height = drive.along_m
    return _point(drive, float(along[-1]) + rover.wheelbase_m, float(height[-1]))


def _point(drive: Drive, distance_m: float, height_m: float) -> tuple[float, float]:
    across, up = drive.question.ground.world(np.array([distance_m]), np.array([height_m]))
    return float(across[0]), float(up[0])
