"""How a rover goes its way: the engine's motion at times, until the horizon or until it arrives somewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

import numpy as np

from service.learning.drive.engine import Motion
from service.learning.drive.inputs import Controls, Route
from service.learning.drive.state import State
from service.physics.scenario import Array
from service.twin.drives.question import DriveQuestion, Driver
from service.twin.scenario import sample_times

T = TypeVar("T")
TimedRoute = tuple[Route, Array]  # and the times (s) at which it is asked for

OWN_STEP_S = 0.05
"""The engine's own cells last so long, or less where torque or brake have just changed."""

_FEWEST_STEPS = 40
_FIRST_STRETCH_S = 10.0  # of a drive that ends somewhere unknown; each further one is as long as all before
_HALVINGS = 34
_LOOKS = 65  # within the step in which a rover arrives


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """Columns (time,): where the rover is at `time_s`, and how fast it and its wheels are. `motion` is the engine's."""

    time_s: Array
    motion: Motion

    def is_finite(self) -> bool:
        """Whether every number of it is; whatever is made of it is then."""
        return all(math.isfinite(column.dot(column)) for column in _columns(self.motion))  # far from overflowing

    def rows(self, times_s: Array) -> Way:
        """Only at some of its times."""
        if times_s is self.time_s:
            return self
        at = np.searchsorted(self.time_s, times_s)
        return Way(times_s, Motion(*(column[at] for column in _columns(self.motion))))


@dataclass(frozen=True, slots=True, eq=False)
class Rover:
    """The rover of a question, at its start."""

    driver: Driver
    question: DriveQuestion
    start: State

    @classmethod
    def of(cls, driver: Driver, question: DriveQuestion) -> Rover:
        """Parked, or with the speed asked for."""
        speed = question.start_speed_m_s
        if speed is not None:
            return cls(driver, question, driver.engine.start(question.mass_kg, speed))
        ground = question.ground
        slope = np.interp(0.5 * driver.prior.rover.wheelbase_m, ground.distance_m, ground.slope_deg)
        return cls(driver, question, driver.start(question.mass_kg, math.radians(slope)))

    def route(self, offset: float = 0.0) -> Route:
        """What the engine drives. `offset` is added to the resistance, as a fraction of the weight."""
        return Route(self.start, self.question.ground.track, self.question.controls, offset)

    def at(self, time_s: Array) -> Way:
        """At times from 0 to the horizon."""
        return Way(time_s, self.driver.engine.along([self.route()], time_s)[0])

    def ways(self, offsets: Sequence[float], time_s: Array) -> Array:
        """Only where it is along the track with each of some offsets, (offset, time)."""
        return self.driver.engine.ways_along([self.route(each) for each in offsets], time_s)

    def until(self, distance_m: float, time_s: Array, own_s: Array) -> tuple[Way, float | None]:
        """The way until it first arrives at a distance (m), and when that is (s; None: not before the last time).

        The way is at those of the times (rising from 0, `own_times` among them) before the arrival, and there.
        """
        parts: list[Way] = []
        state, began, count = self.start, 0.0, 0
        while count < len(time_s):
            until = max(_FIRST_STRETCH_S, 2.0 * began)
            end = max(int(np.searchsorted(time_s, until, side="right")), count + 1)
            part, after = self._stretch(state, began, time_s[count:end])
            reached = np.flatnonzero(part.motion.x_m >= distance_m)
            if reached.size:
                at = int(reached[0])
                end = int(np.searchsorted(own_s, part.time_s[at]))  # between own times: however it is sampled
                arrival = self._arrival(state, began, (float(own_s[end - 1]), float(own_s[end])), distance_m)
                parts += [_part(part, slice(at)), arrival]
                return _joined(parts), float(arrival.time_s[0])
            parts.append(part)
            state, began, count = after, float(part.time_s[-1]), end
        return _joined(parts), None

    def _stretch(self, state: State, began_s: float, time_s: Array) -> tuple[Way, State]:
        """From a state at a time on."""
        controls = _from(self.question.controls, began_s)
        motion, after = self.driver.engine.drive(state, self.question.ground.track, controls, time_s - began_s)
        return Way(time_s, motion), after

    def _arrival(self, state: State, began_s: float, between_s: tuple[float, float], distance_m: float) -> Way:
        """The moment between two times at which the distance is reached, as a way of one time."""
        looks = np.linspace(*between_s, _LOOKS)
        seen = self._stretch(state, began_s, looks)[0].motion
        at = max(int((seen.x_m >= distance_m).argmax()), 1)
        share = crossing_of_way(
            seen.x_m[at - 1 : at + 1], seen.speed_m_s[at - 1 : at + 1], float(looks[at] - looks[at - 1]), distance_m
        )
        time = looks[at - 1] + share * (looks[at] - looks[at - 1])
        return self._stretch(state, began_s, np.array([min(max(time, between_s[0]), between_s[1])]))[0]


def drive_many(asked: Sequence[list[TimedRoute]], drive: Callable[[list[Route], Array], Iterable[T]]) -> list[list[T]]:
    """What `drive` says of the routes of each, called once for all with the same times and times of controls."""
    every = [one for routes in asked for one in routes]
    if len(every) == len(asked) == 1:
        return [list(drive([every[0][0]], every[0][1]))]
    groups: dict[tuple[bytes, bytes], list[int]] = {}
    for at, (route, time_s) in enumerate(every):
        groups.setdefault((time_s.tobytes(), route.controls.time_s.tobytes()), []).append(at)
    found: dict[int, T] = {}
    for rows in groups.values():
        found.update(zip(rows, drive([every[row][0] for row in rows], every[rows[0]][1]), strict=True))
    said = (found[at] for at in range(len(every)))
    return [list(islice(said, len(routes))) for routes in asked]


def own_times(question: DriveQuestion) -> Array:
    """The times at which events, energy and whatever else is no point of the answer are looked for, 0 to the horizon.

    Every 0.05 s, or a fortieth of a short horizon, and whenever torque or brake change.
    """
    horizon = question.horizon_s
    even = sample_times(horizon, min(OWN_STEP_S, horizon / _FEWEST_STEPS))
    if len(question.controls.time_s) == 1:
        return even
    changes = question.controls.time_s[1:]
    changes = changes[changes < horizon]
    if (even[np.searchsorted(even, changes)] == changes).all():
        return even  # and no other array: who asks for the same times is shown these
    return np.union1d(even, changes)


def crossing_of_way(x_m: Array, speed_m_s: Array, step_s: float, distance_m: float) -> float:
    """The share of a step at which a distance is reached, by position and speed at its ends, (2,) each."""
    quadratic, first = _speed_within(x_m, speed_m_s, step_s), float(x_m[0])
    rises = way_within(quadratic, 1.0) > 0.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if (way_within(quadratic, middle) * step_s + first >= distance_m) == rises:
            high = middle
        else:
            low = middle
    return high


def crossing_of_speed(x_m: Array, speed_m_s: Array, step_s: float, level_m_s: float) -> tuple[float, float]:
    """The share of a step at which a speed is reached, and the position (m) then; arguments as above."""
    quadratic = _speed_within(x_m, speed_m_s, step_s)
    share = _root(quadratic, level_m_s)
    return share, float(x_m[0]) + step_s * way_within(quadratic, share)


def way_within(quadratic: tuple[float, float, float], share: float) -> float:
    """The integral of a speed, quadratic in the share of its step, up to a share."""
    first, linear, square = quadratic
    return share * (first + share * (linear / 2.0 + share * square / 3.0))


def _speed_within(x_m: Array, speed_m_s: Array, step_s: float) -> tuple[float, float, float]:
    """The speed within a step as a quadratic of its share: right at both ends and on average."""
    first, last = speed_m_s.tolist()
    mean = float(x_m[1] - x_m[0]) / step_s if step_s > 0 else 0.5 * (first + last)
    square = 3.0 * (first + last) - 6.0 * mean
    return first, last - first - square, square


def _root(quadratic: tuple[float, float, float], level: float) -> float:
    """Where between 0 and 1 a quadratic that is on different sides of a level there comes to it."""
    first, linear, square = quadratic
    gap = first - level
    root = math.sqrt(max(linear * linear - 4.0 * square * gap, 0.0))
    far = -0.5 * (linear + math.copysign(root, linear))
    roots = [gap / far if far else 0.0, *([far / square] if square else [])]
    held = [min(max(each, 0.0), 1.0) for each in roots]
    return min(held, key=lambda share: abs(gap + share * (linear + share * square)))


def _from(controls: Controls, began_s: float) -> Controls:
    """The controls from a time on, counted from there."""
    if began_s == 0 or len(controls.time_s) == 1:
        return controls
    first = int(np.searchsorted(controls.time_s, began_s, side="right")) - 1
    times = np.maximum(controls.time_s[first:] - began_s, 0.0)
    return Controls(times, controls.torque_nm[first:], np.asarray(controls.brake)[first:])


def _columns(motion: Motion) -> tuple[Array, ...]:
    return (
        motion.x_m,
        motion.speed_m_s,
        motion.front_wheel_rad_s,
        motion.rear_wheel_rad_s,
        motion.y_m,
        motion.slope_rad,
    )


def _part(way: Way, rows: slice) -> Way:
    return Way(way.time_s[rows], Motion(*(column[rows] for column in _columns(way.motion))))


def _joined(parts: list[Way]) -> Way:
    columns = zip(*(_columns(part.motion) for part in parts), strict=True)
    return Way(np.concatenate([part.time_s for part in parts]), Motion(*(np.concatenate(each) for each in columns)))
