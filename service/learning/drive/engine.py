"""A law made ready for the compiled engine, and what it can be asked: drives, constant scenarios, steps.

Positions are of the rear wheel along the track, from where it started. The same inputs give the same motion however it
is cut into calls and times: to the bit where calls end with the engine's cells of time (0.02 s until 0.3 s after an
event, 0.05 s later; an event is the start or a change of torque or brake), to 1e-9 m elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from ctypes import addressof, c_double
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from service.learning.drive.inputs import Controls, Route, Track, require_slopes
from service.learning.drive.law import LaidOutLaw, Law
from service.learning.drive.library import HEIGHTS, MOST_S, OUTPUTS, address, contiguous, library
from service.learning.drive.state import SIZE, State, states_array
from service.learning.drive.threads import in_parts
from service.learning.drive.timetable import (
    Account,
    Timetable,
    require_range,
    rise,
    rising_times,
    sorted_times,
)
from service.learning.drive.whole import Whole, WholesAsked
from service.physics.scenario import Array

SHORTEST_STEP_S = 1e-6
_FEWEST_LANES = 3  # fewer scenarios are driven one by one
_SLOPES_PER_RAD = 50.0  # slopes that count as alike
_Numbers = c_double * len(Account._fields)


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Columns over times or rovers: x (m), speed (m/s), wheel speeds (rad/s), height y (m), slope (rad).

    y is that of the rear wheel centre above the undeformed surface, the slope that under the rover's middle.
    """

    x_m: Array
    speed_m_s: Array
    front_wheel_rad_s: Array
    rear_wheel_rad_s: Array
    y_m: Array
    slope_rad: Array


class Engine:
    """Moves rovers by one law. Holds what the compiled code reads, which nobody changes: safe to share by threads."""

    def __init__(self, law: Law) -> None:
        self.law = law
        self._number = law.number
        self._laid_out = LaidOutLaw(law)
        self._address = self._laid_out.address
        self._flat = LaidOutLaw(law, heights=False)
        self._library = library()

    def start(self, mass_kg: float, start_speed_m_s: float = 0.0) -> State:
        """A rover that begins to move, at 0. Raises ValueError for a mass that is not positive."""
        _require(math.isfinite(mass_kg) and mass_kg > 0, f"mass_kg must be positive, got {mass_kg}")
        _require(math.isfinite(start_speed_m_s), f"start_speed_m_s must be finite, got {start_speed_m_s}")
        numbers = np.empty(SIZE)
        self._library.rover_start(self._address, mass_kg, start_speed_m_s, address(numbers))
        return State(numbers)

    def start_many(self, mass_kg: Array, start_speed_m_s: Array) -> Array:
        """States (rover, SIZE) of rovers that begin to move, at 0. Raises ValueError as `start` does."""
        masses, speeds = contiguous(mass_kg), contiguous(start_speed_m_s)
        _require(np.isfinite(masses).all() and (masses > 0).all(), "masses must be positive")
        _require(np.isfinite(speeds).all(), "start speeds must be finite")
        numbers = np.empty((len(masses), SIZE))
        at = address(numbers)
        for row, (mass, speed) in enumerate(zip(masses.tolist(), speeds.tolist(), strict=True)):
            self._library.rover_start(self._address, mass, speed, at + row * numbers.itemsize * SIZE)
        return numbers

    def restore(self, data: bytes, mass_kg: float | None = None) -> State:
        """A state from its bytes. Raises ValueError unless it is one of this law, and of this mass if one is given."""
        state = State.from_bytes(data)
        self._require_own(state)
        if mass_kg is not None and state.mass_kg != mass_kg:
            raise ValueError(f"the state is of a rover of {state.mass_kg:g} kg, not of {mass_kg:g} kg")
        return state

    def drive(
        self, start: State, track: Track, controls: Controls, time_s: Array, offset: float = 0.0
    ) -> tuple[Motion, State]:
        """Motion at times (s, from the state on, rising) and the state at the last one.

        Controls count from the state on too; the track is where it always was. `offset` is added to the resistance, as
        a fraction of the weight. Raises ValueError for a state of another law and for times that fall, are negative,
        not finite or beyond MOST_S.
        """
        self._require_own(start)
        _require(math.isfinite(offset), f"offset must be finite, got {offset}")
        times = rising_times(time_s)
        numbers, outputs = start.numbers.copy(), np.empty((OUTPUTS, len(times)))
        along, told = track.compiled(), controls.compiled()
        self._library.rover_drive(
            self._address,
            address(numbers),
            addressof(along),
            addressof(told),
            offset,
            len(times),
            address(times),
            address(outputs),
        )
        return Motion(*outputs), State(numbers)

    def along(self, routes: Sequence[Route], time_s: Array) -> list[Motion]:
        """The motion of `drive` for each of many, to the bit, at the same times.

        Routes that follow each other go side by side if they begin, and change and brake at the same times. Raises
        ValueError as `drive` does.
        """
        found = self._along(self._address, routes, time_s, OUTPUTS)
        return [Motion(*found[:, row]) for row in range(len(routes))]

    def ways_along(self, routes: Sequence[Route], time_s: Array) -> Array:
        """The x (route, time) of `along` alone, to the bit: a seventh sooner, as nothing is said of heights."""
        return np.asarray(self._along(self._flat.address, routes, time_s, 1)[0])

    def _along(self, law: int, routes: Sequence[Route], time_s: Array, columns: int) -> Array:
        """Columns (columns, route, time)."""
        times, count = rising_times(time_s), len(routes)
        for each in routes:
            self._require_own(each.start)
            _require(math.isfinite(each.offset), f"offset must be finite, got {each.offset}")
        compiled = b"".join(map(Route.packed, routes))
        outputs = np.empty((columns, count, len(times)))
        self._library.rover_drives(law, count, compiled, len(times), address(times), columns, address(outputs))
        return outputs

    def constant(
        self,
        slope_rad: Array,
        mass_kg: Array,
        torque_nm: Array,
        start_speed_m_s: Array | float,
        time_s: Array,
        offset: Array | float = 0.0,
    ) -> tuple[Array, Array, Array, Array, Array]:
        """x, speed, front and rear wheel speed, y, each (scenario, time), of scenarios that begin to move at 0.

        Columns are (scenario,), times (time,) or (scenario, time), in any order. What one scenario gets does not depend
        on the others, to the bit. Raises ValueError as `drive` does.
        """
        columns = slope_rad, mass_kg, torque_nm, start_speed_m_s, offset
        found = self._constant(self._address, columns, contiguous(time_s), 5)
        return found[0], found[1], found[2], found[3], found[4]

    def places(
        self,
        slope_rad: Array,
        mass_kg: Array,
        torque_nm: Array,
        start_speed_m_s: Array | float,
        time_s: Array,
        offset: Array | float = 0.0,
    ) -> tuple[Array, Array]:
        """The x and y (scenario, time) of `constant` alone, to the bit: sooner, as nothing is said of speeds."""
        columns = slope_rad, mass_kg, torque_nm, start_speed_m_s, offset
        found = self._constant(self._address, columns, contiguous(time_s), 2)
        return found[0], found[-1]

    def ways(
        self,
        slope_rad: Array,
        mass_kg: Array,
        torque_nm: Array,
        start_speed_m_s: Array | float,
        time_s: Array,
        offset: Array | float = 0.0,
    ) -> Array:
        """The x (scenario, time) of `constant` alone, to the bit: sooner, as nothing is said of heights."""
        columns = slope_rad, mass_kg, torque_nm, start_speed_m_s, offset
        return np.asarray(self._constant(self._flat.address, columns, contiguous(time_s), 1)[0])

    def whole(
        self,
        slope_rad: Array,
        mass_kg: Array,
        torque_nm: Array,
        start_speed_m_s: Array | float,
        time_s: Array,
        horizon_s: Array,
        look_s: Array,
        *,
        moving: bool = True,
    ) -> tuple[tuple[Array, ...], Whole]:
        """The columns of `constant` at times that do not fall, and what each way comes to until its horizon.

        Of those that are not `moving` x and y alone, sooner. `horizon_s` is (scenario,), `look_s` up to two
        times at which the ways are looked at besides. Raises ValueError as `constant` does.
        """
        columns = slope_rad, mass_kg, torque_nm, start_speed_m_s, 0.0
        wanted = 5 if moving else 2
        found, whole = self._whole(self._address, columns, contiguous(time_s), horizon_s, look_s, wanted)
        return tuple(found), whole

    def whole_ways(
        self,
        slope_rad: Array,
        mass_kg: Array,
        torque_nm: Array,
        start_speed_m_s: Array | float,
        horizon_s: Array,
        look_s: Array,
    ) -> Whole:
        """What `whole` says of each way, to the bit, but for heights and lengths of paths, which are 0: sooner."""
        columns = slope_rad, mass_kg, torque_nm, start_speed_m_s, 0.0
        return self._whole(self._flat.address, columns, np.empty(0), horizon_s, look_s, 1)[1]

    def _whole(
        self, law: int, columns: Sequence[Array | float], time: Array, horizon_s: Array, look_s: Array, wanted: int
    ) -> tuple[Array, Whole]:
        scenarios, horizons = _scenarios(columns), contiguous(horizon_s)
        count = scenarios.shape[1]
        _require(rise(time), "times must not fall")
        _require(time.ndim == 1 or len(time) == count, f"times {time.shape} do not fit {count} scenarios")
        for times in (time, horizons[:, None], look_s):
            require_range(times)
        _require(horizons.shape == (count,), f"horizons {horizons.shape} do not fit {count} scenarios")
        asked = WholesAsked(horizons, look_s)
        return self._side_by_side(law, scenarios, time, wanted, asked), asked.found()

    def _constant(self, law: int, columns: Sequence[Array | float], time: Array, wanted: int) -> Array:
        """Columns (wanted, scenario, time): all five, x and y, or x alone; a few scenarios give five in any case."""
        scenarios = _scenarios(columns)
        count = scenarios.shape[1]
        if time.ndim == 2:
            _require(len(time) == count, f"times {time.shape} do not fit {count} scenarios")
        back = None
        if not rise(time):
            _require(not np.isnan(time).any(), f"times must be 0 to {MOST_S:g} s")  # no order sorts them
            time, back = sorted_times(time)
        require_range(time)
        if count < _FEWEST_LANES:
            outputs = self._one_by_one(law, scenarios, time)
        else:
            outputs = self._side_by_side(law, scenarios, time, wanted)
        if back is None:
            return outputs
        return outputs.take(back, axis=2) if time.ndim == 1 else np.take_along_axis(outputs, back[None], axis=2)

    def _one_by_one(self, law: int, scenarios: Array, time: Array) -> Array:
        count, times = scenarios.shape[1], time.shape[-1]
        stride, outputs = 0 if time.ndim == 1 else times, np.empty((5, count, times))
        rows, moments = address(scenarios), address(time)
        self._library.rover_constant(law, count, rows, times, moments, stride, address(outputs))
        return outputs

    def _side_by_side(
        self, law: int, scenarios: Array, time: Array, wanted: int, asked: WholesAsked | None = None
    ) -> Array:
        count, times = scenarios.shape[1], time.shape[-1]
        stride, outputs = 0 if time.ndim == 1 else times, np.empty((wanted, count, times))
        ends = time[:, -1] if time.ndim == 2 and times else None
        order = _alike(scenarios, ends)
        firsts, rows, moments, to = address(order), address(scenarios), address(time), address(outputs)
        wholes = None if asked is None else addressof(asked.compiled)

        def driven(first: int, end: int) -> None:
            some = firsts + first * order.itemsize
            self._library.rover_side_by_side(
                law, end - first, some, count, rows, times, moments, stride, wanted, to, wholes
            )

        in_parts(driven, count)
        return outputs

    def scenario(
        self, release: int, table: Timetable, slope_rad: float, mass_kg: float, torque_nm: float, columns: int
    ) -> tuple[Array, Account]:
        """One scenario of `constant` from rest, and what its way comes to.

        Rows (columns, shown): x and y; of 5 also speed, front and rear wheel speed. Of numbers that are known to be
        right. `release` is the address of the compiled start speeds.
        """
        outputs, account = np.empty((columns, table.times)), _Numbers()
        self._library.rover_scenario(
            self._address,
            release,
            table.address,
            slope_rad,
            mass_kg,
            torque_nm,
            columns,
            address(outputs),
            addressof(account),
        )
        return outputs[:, : table.shown], Account._make(account[:])

    def height_features(self, start: State, track: Track, controls: Controls, time_s: Array) -> Array:
        """What the height at times would be for each of `heights` alone being 1, (time, HEIGHTS): to fit these."""
        columns = []
        for number in range(HEIGHTS):
            heights = np.zeros(HEIGHTS)
            heights[number] = 1.0
            alone = Engine(replace(self.law, heights=heights))
            numbers = start.numbers.copy()
            numbers[1] = alone.law.number
            columns.append(alone.drive(State(numbers), track, controls, time_s)[0].y_m)
        return np.stack(columns, axis=1)

    def step(
        self,
        states: Sequence[State] | Array,
        slope_rad: Array | float,
        torque_nm: Array | float,
        brake: npt.NDArray[np.bool_] | bool,
        dt_s: Array | float,
        track: Track | None = None,
    ) -> tuple[Array, Motion]:
        """Advances rovers, each by its own `dt_s`: the new states (rover, SIZE) and their motion, columns (rover,).

        The slope given holds under each rover's middle during its step; along a track it is not looked at. Raises
        ValueError for states of another law, and for numbers that cannot be.
        """
        numbers = states_array(states).copy()
        count = len(numbers)
        inputs = np.empty((4, count))
        for row, column in zip(inputs, (slope_rad, torque_nm, brake, dt_s), strict=True):
            row[:] = column
        _require((numbers[:, 1] == self._number).all(), "a state belongs to another law")
        require_slopes(inputs[0])
        _require(np.isfinite(inputs).all() and (inputs[1] >= 0).all(), "torques must be finite and not negative")
        _require(
            (inputs[3] >= SHORTEST_STEP_S).all() and (inputs[3] <= MOST_S).all(),
            f"dt_s must be {SHORTEST_STEP_S:g} to {MOST_S:g}",
        )
        return numbers, Motion(*self.advance(numbers, inputs, track))

    def advance(self, numbers: Array, inputs: Array, track: Track | None = None) -> Array:
        """`step` in place, of what is known to be right: the columns of the motion, (OUTPUTS, rover).

        `numbers` (rover, SIZE) and `inputs` (4, rover), slope (rad), torque, brake and duration, in one piece each.
        """
        count, outputs = len(numbers), np.empty((OUTPUTS, len(numbers)))
        rovers = self._address, count, address(numbers), address(inputs)
        if track is None:
            self._library.rover_step_fleet(*rovers, address(outputs))
        else:
            self._library.rover_step(*rovers, addressof(track.compiled()), address(outputs))
        return outputs

    def advance_one(self, numbers: int, inputs: int, outputs: int) -> None:
        """`advance` of one rover without a track, of and to arrays at these addresses."""
        self._library.rover_step(self._address, 1, numbers, inputs, None, outputs)

    def _require_own(self, state: State) -> None:
        if state.law != self._number:
            raise ValueError("the state belongs to another model, or to another version of this one: start anew")


def _scenarios(columns: Sequence[Array | float]) -> Array:
    """Slope, mass, torque, start speed and offset as the engine has them, (5, scenario). Raises ValueError."""
    scenarios = np.empty((5, np.size(columns[0])))
    for row, column in zip(scenarios, columns, strict=True):
        row[:] = column
    require_slopes(scenarios[0])
    _require(np.isfinite(scenarios).all(), "scenarios must be finite")
    _require((scenarios[1] > 0).all() and (scenarios[2] >= 0).all(), "masses must be positive, torques not negative")
    return scenarios


def _alike(scenarios: Array, ends: Array | None) -> npt.NDArray[np.int64]:
    """Numbers of scenarios (5, scenario), alike ones beside each other: by their last time, then slope, then torque.

    The engine drives some of them side by side, each as long and with as many turns as the one that needs most.
    """
    keys = [scenarios[2] / scenarios[1], np.floor(scenarios[0] * _SLOPES_PER_RAD)]
    return np.lexsort(keys if ends is None else [*keys, ends]).astype(np.int64, copy=False)


def _require(holds: bool | np.bool_, otherwise: str) -> None:
    if not holds:
        raise ValueError(otherwise)
