"""One rover at a time, in plain numbers: for one of them, arrays take longer than the arithmetic."""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np

from service.learning.drive.engine import Engine
from service.learning.drive.library import OUTPUTS, address
from service.learning.drive.state import SIZE
from service.physics.scenario import Array
from service.twin.steps.half_width import Given


class Moment(NamedTuple):
    """One rover at the end of its step, as `Moments` have many. `finite`: whether it has an answer."""

    time_s: float
    x_m: float
    y_m: float
    speed_m_s: float
    rear_wheel_speed_rad_s: float
    front_wheel_speed_rad_s: float
    slip_ratio: float
    x_half_width_m: float
    moving: bool
    outside_of: list[str]
    finite: bool


class InPlace:
    """States (rover, number) in one piece, of which the engine moves one where it lies. Only of one thread.

    `numbers` are those of all rovers, one after the other.
    """

    def __init__(self, states: Array) -> None:
        self.states = states
        self.numbers = _plain(states.reshape(-1))
        self._size, self._address = int(states.shape[1]), address(states)
        inputs, self._outputs = np.empty(4), np.empty(OUTPUTS)
        self._inputs, self._given = _plain(inputs), address(inputs)
        self._found = address(self._outputs)

    def start_of(self, row: int) -> int:
        """Where in `numbers` a rover's begin."""
        return row * self._size

    def carried(self, row: int) -> list[float]:
        """What a rover carries beside the engine's numbers."""
        start = row * self._size
        return list(self.numbers[start + SIZE : start + self._size])

    def carry(self, row: int, carried: tuple[float, ...]) -> None:
        """Puts it there."""
        numbers = self.numbers
        for at, number in enumerate(carried, row * self._size + SIZE):
            numbers[at] = number

    def moved(self, engine: Engine, row: int, given: Given) -> list[float]:
        """Moves one on: the engine's outputs."""
        inputs = self._inputs
        inputs[0], inputs[1], inputs[2], inputs[3] = given
        engine.advance_one(self._address + 8 * row * self._size, self._given, self._found)
        return self._outputs.tolist()


def _plain(array: Array) -> memoryview[float]:
    """The same memory, out of which a plain number takes a third of the time."""
    return cast("memoryview[float]", memoryview(cast("Any", array)))
