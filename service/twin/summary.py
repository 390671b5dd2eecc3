"""What a trajectory comes to: does the rover climb, stall or slide, how far, how fast, with how much slip.

The model is asked for that at times of its own, so that the points of an answer change none of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from service.learning.doubt.outcomes import Class, classes
from service.physics.scenario import Array, Motion, Positions


class Outcome(StrEnum):
    """How a scenario ends, judged by the mean speed over the last quarter of the horizon.

    A rover that goes up then, but is still below its start, has slid. A version that knows its errors says what is most
    probable, which may differ from what its trajectory does.
    """

    CLIMBS = "climbs"
    STALLS = "stalls"
    SLIDES = "slides"


NAMED = {Class.CLIMBS.value: Outcome.CLIMBS, Class.STALLS.value: Outcome.STALLS, Class.SLIDES.value: Outcome.SLIDES}
"""Outcomes by their numbers in `Class`."""


LAST_PART = 0.25

# The horizon is cut into so many equal parts, 25 ms of 10 s, however long it is: what is missed is how far the rover
# gets within one part before it turns back. A model that takes as long as its points are many gets fewer.
_SHARES, _SHARES_OF_SLOW_MODELS = (np.arange(parts + 1) / parts for parts in (400, 40))


@dataclass(unsafe_hash=True, slots=True)
class Summary:
    """The trajectory in six numbers, slope frame, the same however it is sampled. `distance_m` is the path's length.

    Nobody changes one.

    `slip_ratio` is 1 - v/(R_w w) of the mean speed, w the mean of all wheels that the model predicts, or else follows
    from the motors' balance; None where the wheels stand still or the version does not know how its wheels turn.
    """

    outcome: Outcome
    final_x_m: float
    final_y_m: float
    distance_m: float
    mean_speed_m_s: float
    slip_ratio: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Summaries:
    """The `Summary` of many trajectories in columns, arrays of shape (scenario,)."""

    outcome: tuple[Outcome, ...]
    final_x_m: Array
    final_y_m: Array
    distance_m: Array
    mean_speed_m_s: Array
    slip_ratio: tuple[float | None, ...]

    def __getitem__(self, row: int) -> Summary:
        return Summary(
            outcome=self.outcome[row],
            final_x_m=float(self.final_x_m[row]),
            final_y_m=float(self.final_y_m[row]),
            distance_m=float(self.distance_m[row]),
            mean_speed_m_s=float(self.mean_speed_m_s[row]),
            slip_ratio=self.slip_ratio[row],
        )

    def only(self, rows: npt.NDArray[np.intp]) -> Summaries:
        """Some of them; the arrays are copies."""
        kept = rows.tolist()
        return Summaries(
            outcome=tuple(self.outcome[row] for row in kept),
            final_x_m=self.final_x_m[rows],
            final_y_m=self.final_y_m[rows],
            distance_m=self.distance_m[rows],
            mean_speed_m_s=self.mean_speed_m_s[rows],
            slip_ratio=tuple(self.slip_ratio[row] for row in kept),
        )


def outcome_of(late_speed_m_s: float, end_m: float = 0.0) -> Outcome:
    """The outcome for a mean speed over the last quarter of the horizon, and a last position."""
    return outcomes_of(np.array([late_speed_m_s]), np.array([end_m]))[0]


def outcomes_of(late_speeds_m_s: Array, ends_m: Array) -> tuple[Outcome, ...]:
    """The outcomes for mean speeds over the last quarter of the horizon and last positions, shape (scenario,)."""
    return named(classes(late_speeds_m_s, ends_m))


def named(found: npt.NDArray[np.intp]) -> tuple[Outcome, ...]:
    """Outcomes by their numbers in `Class`, shape (scenario,)."""
    return tuple(NAMED[each] for each in found.tolist())


def own_times(horizons_s: Array, *, quick: bool) -> Array:
    """The times that a summary is made of, from 0 to the horizon, evenly: (time,) where all horizons are one, otherwise
    (scenario, time).
    """
    shares = _SHARES if quick else _SHARES_OF_SLOW_MODELS
    shared = len(horizons_s) == 1 or (horizons_s == horizons_s[0]).all()
    return np.asarray(horizons_s[0] * shares if shared else horizons_s[:, None] * shares)


def late(own: Array) -> Array:
    """The values, (scenario,), where the last part of the horizon begins, of those at `own_times`."""
    return own[:, late_place(own.shape[1])]


def late_place(times: int) -> int:
    """Which of so many `own_times` it is."""
    return round((1.0 - LAST_PART) * (times - 1))


def path_length_m(positions: Positions) -> Array:
    """Sum of the straight ways between samples, shape (scenario,). `hypot` would take three times as long."""
    x, y = positions.x_m, positions.y_m
    squares = np.square(x[:, 1:] - x[:, :-1])
    squares += np.square(y[:, 1:] - y[:, :-1])
    return np.asarray(np.sqrt(squares, out=squares).sum(axis=1))


def mean_wheel_speed_rad_s(own: Positions) -> Array | None:
    """Mean over both axles and the horizon, shape (scenario,), of a motion at `own_times`; None where not known."""
    if not isinstance(own, Motion) or own.rear_wheel_speed_rad_s is None or own.front_wheel_speed_rad_s is None:
        return None
    wheels = own.rear_wheel_speed_rad_s + own.front_wheel_speed_rad_s
    ends = wheels[:, 0] + wheels[:, -1]
    return np.asarray((wheels.sum(axis=1) - 0.5 * ends) / (2.0 * (wheels.shape[1] - 1)))
