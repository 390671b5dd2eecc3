"""Moves rovers of one version on, step by step, and says where they are, how sure that is and whether it is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.drive.library import OUTPUTS, CompiledState
from service.learning.drive.model import DriveModel
from service.learning.drive.state import FORMAT, SIZE
from service.physics.scenario import Array
from service.twin.moment import MOVES_M_S, moves, slip_ratio, slip_ratios
from service.twin.steps.half_width import CARRIED, Given, HalfWidths, until_look_s, until_looks_s
from service.twin.steps.one import InPlace, Moment
from service.twin.steps.states import StateError, some_at_once
from service.twin.steps.verdict import StepDomain
from service.twin.twin import Twin

STATE_SIZE = SIZE + CARRIED
"""Numbers of a rover's state: those of the engine, and what the half-width needs."""

_AT = {name: at for at, (name, _) in enumerate(CompiledState._fields_)}
_FORMAT, _LAW, _MASS, _TIME, _RATE = (_AT[name] for name in ("format", "law", "mass_kg", "time_s", "rate_per_s"))
_NO_TIME_S = 1e-9
_COLUMNS = tuple(name for name in Moment._fields if name not in ("outside_of", "finite"))
_LIGHTEST_KG, _HEAVIEST_KG = 1e-6, 1e12  # of states that come from elsewhere: what can be computed with


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """Rovers at the end of their steps, columns (rover,).

    `x_half_width_m` is NaN where the version knows no doubt. `outside_of` has of each rover the inputs that are outside
    the domain. `finite` says which have an answer, None for all of them: only forged states have none.
    """

    time_s: Array
    x_m: Array
    y_m: Array
    speed_m_s: Array
    rear_wheel_speed_rad_s: Array
    front_wheel_speed_rad_s: Array
    slip_ratio: Array
    x_half_width_m: Array
    moving: npt.NDArray[np.bool_]
    outside_of: list[list[str]]
    finite: npt.NDArray[np.bool_] | None = None

    @classmethod
    def of_one(cls, one: Moment) -> Moments:
        """Those of one rover."""
        numbers = {name: np.array([getattr(one, name)]) for name in _COLUMNS}
        finite = None if one.finite else np.zeros(1, dtype=np.bool_)
        return cls(**numbers, outside_of=[one.outside_of], finite=finite)

    def only(self, rows: npt.NDArray[np.intp]) -> Moments:
        """Those of some rovers."""
        chosen = {name: getattr(self, name)[rows] for name in _COLUMNS}
        return Moments(**chosen, outside_of=[self.outside_of[row] for row in rows.tolist()])


@dataclass(frozen=True, slots=True, eq=False)
class Stepper:
    """Moves rovers of a twin; immutable, safe to share by threads. Raises InvalidValueError for one that cannot."""

    twin: Twin
    model: DriveModel = field(init=False, repr=False)
    _half_widths: HalfWidths | None = field(init=False, repr=False)
    _domain: StepDomain = field(init=False, repr=False)

    def __post_init__(self) -> None:
        twin = self.twin
        if not isinstance(twin.model, DriveModel):
            said = f"{twin.name}@{twin.version}"
            raise InvalidValueError("model", said, "a version of architecture drive_model: others know no steps")
        object.__setattr__(self, "model", twin.model)
        object.__setattr__(self, "_half_widths", HalfWidths(twin.doubt) if twin.doubt else None)
        object.__setattr__(self, "_domain", StepDomain(twin.domain))

    def start(self, mass_kg: Array, slope_deg: Array, start_speed_m_s: Array) -> Array:
        """States (rover, STATE_SIZE) of rovers at 0; columns (rover,). A speed of NaN: parked, and let go."""
        parked, speeds = np.isnan(start_speed_m_s), start_speed_m_s
        if parked.any():
            speeds = np.where(parked, self.model.starts.at(np.radians(slope_deg), mass_kg), start_speed_m_s)
        return np.hstack([self.model.engine.start_many(mass_kg, speeds), HalfWidths.begun(len(speeds))])

    def wrong(self, numbers: Array) -> dict[int, StateError]:
        """What is wrong with numbers that came from elsewhere, (state, ...), by row: those must not be advanced."""
        if numbers.shape[1] != STATE_SIZE:
            other = StateError(f"it has {numbers.shape[1]} numbers, this release reads {STATE_SIZE}: start anew")
            return dict.fromkeys(range(len(numbers)), other)
        own = numbers[:, _LAW] == self.model.law.number
        mass = numbers[:, _MASS]
        possible = (mass > _LIGHTEST_KG) & (mass < _HEAVIEST_KG) & (numbers[:, _FORMAT] == FORMAT)
        sound = np.isfinite(numbers).all(axis=1) & possible
        if (own & sound).all():
            return {}
        foreign = StateError("it belongs to another version of that name and number: start anew")
        unsound = StateError("its numbers are not those of a rover")
        return {row: unsound if own[row] else foreign for row in np.flatnonzero(~(own & sound)).tolist()}

    def masses_kg(self, states: Array) -> Array:
        """Of the rovers, (rover,)."""
        return np.asarray(states[:, _MASS])

    def advance(
        self, states: Array, slope_deg: Array, torque_nm: Array, brake: npt.NDArray[np.bool_], dt_s: Array
    ) -> Moments:
        """Moves states (rover, STATE_SIZE) in place; columns (rover,). All of them are known to be right.

        The slope holds under each rover's middle during its step.
        """
        if len(states) == 1:
            whole = np.ascontiguousarray(states)
            one = InPlace(whole)
            found = self.advance_one(one, 0, float(slope_deg[0]), float(torque_nm[0]), bool(brake[0]), float(dt_s[0]))
            states[:] = whole
            return Moments.of_one(found)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # states may be forged
            inputs = np.empty((4, len(states)))
            np.radians(slope_deg, out=inputs[0])
            inputs[1], inputs[2], inputs[3] = torque_nm, brake, dt_s
            outputs = np.empty((OUTPUTS, len(states)))
            for rows in some_at_once(len(states)):
                outputs[:, rows] = self._moved(states[rows], np.ascontiguousarray(inputs[:, rows]))
            return self._moments(states, outputs, slope_deg, torque_nm, brake)

    def advance_one(
        self, states: InPlace, row: int, slope_deg: float, torque_nm: float, brake: bool, dt_s: float
    ) -> Moment:
        """The same of one of many rovers, in plain numbers."""
        slope_rad, braked, left = math.radians(slope_deg), float(brake), dt_s
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # as above
            while left > _NO_TIME_S:
                part = min(left, until_look_s(states.numbers[states.start_of(row) + _TIME]))
                found = self._part_of_one(states, row, (slope_rad, torque_nm, braked, part))
                left -= part
            return self._moment(states, row, found, slope_deg, torque_nm, brake)

    def _part_of_one(self, states: InPlace, row: int, given: Given) -> list[float]:
        found, half = states.moved(self.model.engine, row, given), self._half_widths
        if half is not None:
            numbers, start = states.numbers, states.start_of(row)
            rate, time, mass = numbers[start + _RATE], numbers[start + _TIME], numbers[start + _MASS]
            states.carry(row, half.carry_one(states.carried(row), rate, time, mass, given, found[1]))
        return found

    def _moment(
        self, states: InPlace, row: int, found: list[float], slope_deg: float, torque_nm: float, brake: bool
    ) -> Moment:
        x, speed, front, rear, y, _ = found
        start, half = states.start_of(row), self._half_widths
        time, mass = states.numbers[start + _TIME], states.numbers[start + _MASS]
        return Moment(
            time_s=time,
            x_m=x,
            y_m=y,
            speed_m_s=speed,
            rear_wheel_speed_rad_s=rear,
            front_wheel_speed_rad_s=front,
            slip_ratio=slip_ratio(self.model.prior.rover.wheel_radius_m, speed, rear, front),
            x_half_width_m=math.nan if half is None else half.at_one(states.carried(row), time, x),
            moving=abs(speed) >= MOVES_M_S,
            outside_of=self._domain.outside_of_one(slope_deg, mass, torque_nm, time, brake=brake),
            finite=all(map(math.isfinite, found)),
        )

    def _moments(
        self, states: Array, outputs: Array, slope_deg: Array, torque_nm: Array, brake: npt.NDArray[np.bool_]
    ) -> Moments:
        x, speed, front, rear, y, _ = outputs
        finite = np.isfinite(outputs)
        time, mass, half = states[:, _TIME].copy(), states[:, _MASS], self._half_widths
        return Moments(
            time_s=time,
            x_m=x,
            y_m=y,
            speed_m_s=speed,
            rear_wheel_speed_rad_s=rear,
            front_wheel_speed_rad_s=front,
            slip_ratio=slip_ratios(self.model.prior.rover.wheel_radius_m, speed, rear, front),
            x_half_width_m=np.full(len(x), np.nan) if half is None else half.at(states[:, SIZE:], time, x),
            moving=moves(speed),
            outside_of=self._domain.outside_of(slope_deg, mass, torque_nm, brake, time),
            finite=None if finite.all() else np.asarray(finite.all(axis=0)),
        )

    def _moved(self, states: Array, inputs: Array) -> Array:
        """Columns of the motion, (OUTPUTS, rover): in parts where scales are looked up underway."""
        if (inputs[3] <= until_looks_s(states[:, _TIME]) + _NO_TIME_S).all():
            return self._part(states, inputs)
        outputs, left = np.empty((OUTPUTS, len(states))), inputs[3].copy()
        while (rows := np.flatnonzero(left > _NO_TIME_S)).size:
            some, given = states[rows], np.ascontiguousarray(inputs[:, rows])
            given[3] = np.minimum(left[rows], until_looks_s(some[:, _TIME]))
            outputs[:, rows] = self._part(some, given)
            states[rows] = some
            left[rows] -= given[3]
        return outputs

    def _part(self, states: Array, inputs: Array) -> Array:
        numbers = np.ascontiguousarray(states[:, :SIZE])
        outputs = self.model.engine.advance(numbers, inputs)
        states[:, :SIZE] = numbers
        if self._half_widths is not None:
            carried, rates, masses = states[:, SIZE:], numbers[:, _RATE], numbers[:, _MASS]
            self._half_widths.carry(carried, rates, numbers[:, _TIME], masses, inputs, outputs[1])
        return outputs


@lru_cache(maxsize=4)
def stepper_of(twin: Twin) -> Stepper:
    """The stepper of a twin, made once. Raises InvalidValueError for one that knows no steps."""
    return Stepper(twin)
