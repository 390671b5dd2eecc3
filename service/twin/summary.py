"""What a trajectory comes to: does the rover climb, stall or slide, how far, how fast, with how much slip."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from service.physics.scenario import Array


class Outcome(StrEnum):
    """How a scenario ends, judged by the mean speed over the last quarter of the horizon."""

    CLIMBS = "climbs"
    STALLS = "stalls"
    SLIDES = "slides"


# Of the 80 shipped Chrono runs, those that go on climbing do so at 22 mm/s or more over their last quarter, those that
# slide back at 107 mm/s or more; the rest creeps at less than 8 mm/s, as a parked rover does in SCM soil.
OUTCOME_SPEED_M_S = 0.015
LAST_PART = 0.25


@dataclass(frozen=True, slots=True)
class Summary:
    """The trajectory in six numbers, slope frame. `distance_m` is the path length over the start and the samples.

    `slip_ratio` is 1 - v/(R_w w) of the mean speed, w from the motors' balance; None where the wheels stand still
    or the version does not know how its wheels turn.
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


def outcome_of(speed_m_s: float) -> Outcome:
    """The outcome for a mean speed over the last quarter of the horizon."""
    if speed_m_s > OUTCOME_SPEED_M_S:
        return Outcome.CLIMBS
    return Outcome.SLIDES if speed_m_s < -OUTCOME_SPEED_M_S else Outcome.STALLS


def outcomes_of(speeds_m_s: Array) -> tuple[Outcome, ...]:
    """The outcomes for mean speeds over the last quarter of the horizon, shape (scenario,)."""
    return tuple(map(outcome_of, speeds_m_s.tolist()))
