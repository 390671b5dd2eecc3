"""What a twin needs of a model, whatever is inside it. Neither this nor a model without a network imports torch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from service.learning.observed import ObservedRun
from service.physics.prior import Prior
from service.physics.scenario import Array, Motion, Positions, Scenarios

# Of the central difference: its error is some micrometres per second, that of float32 positions some tens of them.
_STEP_S = 0.005


class TrajectoryModel(Protocol):
    """What a twin needs of a model: trajectories of scenarios, and the prior that they are compared with."""

    @property
    def prior(self) -> Prior:
        """The physics that the model starts from; it holds rover and regolith."""
        ...

    @property
    def quick(self) -> bool:
        """Whether a scenario takes well under a millisecond, at 20,000 times too."""
        ...

    @property
    def knows_wheel_speeds(self) -> bool:
        """Whether `motion` says how fast the wheels turn."""
        ...

    def positions(self, scenarios: Scenarios, time_s: Array) -> Positions:
        """Positions (m), shape (scenario, time), at `time_s` of shape (time,) or (scenario, time).

        One array operation over many scenarios, or almost: what a scenario gets depends on the others by rounding only
        (of float32 where a network answers), and besides the answer memory is bounded however many there are.
        """
        ...

    def motion(self, scenarios: Scenarios, time_s: Array) -> Motion:
        """The same positions with the speed at each time and, where `knows_wheel_speeds`, that of both axles' wheels.

        What it says of a time does not depend on the other times. It may cost several times what `positions` does.
        """
        ...


def motion_by_difference(
    positions: Callable[[Scenarios, Array], Positions], scenarios: Scenarios, time_s: Array
) -> Motion:
    """`TrajectoryModel.motion` for a model of rovers that begin at rest and of which only `positions` are known.

    The speed is a central difference over 10 ms, asked at times of its own. At less than 5 ms the way goes on mirrored
    in time, which is what a way from rest does: the speed is zero at the start.
    """
    count = time_s.shape[-1]
    times = np.concatenate([time_s, np.abs(time_s - _STEP_S), time_s + _STEP_S], axis=-1)
    found = positions(scenarios, times)
    x, before, after = (found.x_m[:, part * count : (part + 1) * count] for part in range(3))
    return Motion(x, found.y_m[:, :count], (after - before) / (2.0 * _STEP_S))


@runtime_checkable
class DrivesRuns(Protocol):
    """What a model has besides that knows runs whose slope, torque or brake change underway."""

    def drive_run(self, run: ObservedRun) -> Positions:
        """Positions (m), shape (1, time) at the run's times, from its inputs: slopes, torques, brake and mass."""
        ...
