"""What a drive comes to: how it ends and how sure that is, when it arrives, what it costs, how steep it gets."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from service.learning.doubt.excursions import late_part, mean_speed
from service.learning.doubt.outcomes import Class, classes
from service.physics.parameters import RoverParameters
from service.physics.scenario import Array, Positions
from service.twin.drives.question import Told
from service.twin.drives.way import Way
from service.twin.summary import path_length_m


class DriveOutcome(StrEnum):
    """How a drive ends, by the mean speed over its last quarter (of the time in which motors drive, if they do).

    A rover that goes up then, but is still below its start, has slid.
    """

    PASSES = "passes"
    STICKS = "sticks"
    SLIDES = "slides"


OUTCOMES = {Class.CLIMBS: DriveOutcome.PASSES, Class.STALLS: DriveOutcome.STICKS, Class.SLIDES: DriveOutcome.SLIDES}


@dataclass(frozen=True, slots=True)
class Probabilities:
    """How probable each outcome is; they add up to 1."""

    passes: float
    sticks: float
    slides: float


@dataclass(frozen=True, slots=True)
class Arrival:
    """When the rear wheel is where the drive was to end (s), and between which times with a probability of `level`.

    None: not before the horizon.
    """

    time_s: float | None
    earliest_s: float | None
    latest_s: float | None


@dataclass(frozen=True, slots=True)
class DriveSummary:
    """The drive in a few numbers, the same however it is sampled, positions in the slope frame.

    `outcome` is the most probable one; without `probabilities`, of a version that does not know its errors, that of the
    trajectory. `motor_energy_j` is what the motors give to all wheels, `steepest_slope_deg` the slope of largest size
    that the middle of the rover meets, at `steepest_at_m` along the track.
    """

    outcome: DriveOutcome
    probabilities: Probabilities | None
    arrival_time_s: float | None
    arrival_earliest_s: float | None
    arrival_latest_s: float | None
    motor_energy_j: float
    steepest_slope_deg: float
    steepest_at_m: float
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    duration_s: float


def outcome_of(way: Way, told: Told) -> DriveOutcome:
    """That of the trajectory itself."""
    seconds = late_part(way.time_s, told.driven)
    x = way.motion.x_m
    found = classes(np.array([mean_speed(x, way.time_s, seconds)]), np.array([x[-1] - x[0]]))
    return OUTCOMES[Class(int(found[0]))]


def motor_energy_j(rover: RoverParameters, way: Way, told: Told) -> float:
    """Mechanical energy that the motors give to the wheels: the integral of torque times wheel speed, all wheels.

    A motor's torque falls from the stall torque to zero at the no-load speed, is zero above and full for a wheel that
    turns backwards, which takes energy. By trapezoids between the way's own times; the wheels' speeds at a time are
    those under the torque until then, so that a step in which the torque is new has that of its end throughout.
    """
    each = 0.5 * rover.wheels
    wheels = np.array([way.motion.front_wheel_rad_s, way.motion.rear_wheel_rad_s])
    share = np.minimum(np.maximum(1.0 - wheels / rover.no_load_speed_rad_s, 0.0), 1.0)
    front, rear = share * wheels
    power = front + rear  # of one wheel of each axle, per N m of stall torque
    torque, last, steps = told.torque_nm[:-1], power[1:], way.time_s[1:] - way.time_s[:-1]
    fresh = np.flatnonzero(torque[1:] != torque[:-1]) + 1
    first = power[:-1].copy()
    for rows in (slice(0, 1), fresh):
        first[rows] = last[rows]
    return float(each * np.dot(torque * steps, 0.5 * (first + last)))


def distance_m(way: Way) -> float:
    """Length of the path."""
    return float(path_length_m(Positions(way.motion.x_m[None], way.motion.y_m[None]))[0])


def mean_speed_m_s(way: Way) -> float:
    """Along the track, from the first time to the last."""
    x: Array = way.motion.x_m
    return float((x[-1] - x[0]) / way.time_s[-1])
