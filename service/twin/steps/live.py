"""Rovers by id, in memory, moved on step by step: what a simulator or a notebook asks without a server."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.drive.engine import SHORTEST_STEP_S
from service.learning.drive.library import MOST_S
from service.physics.scenario import Array
from service.twin.steps.one import InPlace, Moment
from service.twin.steps.states import StateError, read_states, write_states
from service.twin.steps.stepper import STATE_SIZE, Moments, stepper_of
from service.twin.twin import Twin

Numbers: TypeAlias = float | Sequence[float] | Array
"""One number for all rovers, or one for each."""

_FIRST_ROOM = 4


class Live:
    """Rovers of one twin. Not to be used by several threads at once.

        live = Live(twin)
        live.start("a", mass_kg=430, slope_deg=10)
        live.step("a", slope_deg=10, torque_nm=60, dt_s=0.1).x_m

    Many rovers are one call: ids as a list, and columns or single numbers for the rest. Raises InvalidValueError for a
    version that knows no steps, and KeyError for rovers that there are not.
    """

    def __init__(self, twin: Twin) -> None:
        self.stepper = stepper_of(twin)
        self._rows: dict[str, int] = {}
        self._free: list[int] = []
        self._hold(np.zeros((_FIRST_ROOM, STATE_SIZE)))

    def __len__(self) -> int:
        return len(self._rows)

    def __contains__(self, rover: object) -> bool:
        return rover in self._rows

    @property
    def ids(self) -> list[str]:
        """Of the rovers there are."""
        return list(self._rows)

    @property
    def twin(self) -> Twin:
        """The version that moves them."""
        return self.stepper.twin

    def start(
        self,
        ids: str | Sequence[str],
        *,
        mass_kg: Numbers,
        slope_deg: Numbers,
        start_speed_m_s: Numbers | None = None,
    ) -> None:
        """Puts rovers to the start, at x = 0 and time 0; those that there are already start anew.

        Without a speed they are parked on the slope and let go. Raises InvalidValueError.
        """
        names = _listed(ids)
        mass = _column("mass_kg", mass_kg, len(names))
        slope = _column("slope_deg", slope_deg, len(names))
        _require("mass_kg", mass, (mass > 0) & np.isfinite(mass), "positive and finite")
        _require_slopes(slope)
        speed = np.full(len(names), np.nan)
        if start_speed_m_s is not None:
            speed = _column("start_speed_m_s", start_speed_m_s, len(names))
            _require("start_speed_m_s", speed, np.isfinite(speed), "finite")
        self.put(names, self.stepper.start(mass, slope, speed))

    def step(
        self,
        ids: str | Sequence[str],
        *,
        slope_deg: Numbers,
        torque_nm: Numbers = 0.0,
        dt_s: Numbers,
        brake: bool | Sequence[bool] | npt.NDArray[np.bool_] = False,
    ) -> Moments:
        """Moves rovers on by `dt_s` each and says where they are then, in the order of `ids`.

        The slope is that under each rover's middle, the torque the stall torque of each wheel's motor; with the brake,
        motors are off and wheels locked. Raises InvalidValueError.
        """
        names = _listed(ids)
        if not names:
            raise InvalidValueError("ids", "none", "one rover or more")
        if len(set(names)) < len(names):
            twice = next(name for at, name in enumerate(names) if name in names[:at])
            raise InvalidValueError("ids", twice, "each rover once")
        slope, torque = _column("slope_deg", slope_deg, len(names)), _column("torque_nm", torque_nm, len(names))
        dt = _column("dt_s", dt_s, len(names))
        _require_slopes(slope)
        _require("torque_nm", torque, (torque >= 0) & np.isfinite(torque), "zero or positive, and finite")
        within = (dt >= SHORTEST_STEP_S) & (dt <= MOST_S)
        _require("dt_s", dt, within, f"{SHORTEST_STEP_S:g} to {MOST_S:g}")
        told = _flags("brake", brake, len(names))
        return self.advance(names, slope, torque, told, dt)[1]

    def states(self, ids: str | Sequence[str] | None = None) -> dict[str, bytes]:
        """What to go on from, here or elsewhere, by id; of all rovers if none are named."""
        names = self.ids if ids is None else _listed(ids)
        numbers = self._states[self._rows_of(names)]
        return dict(zip(names, write_states(self.twin.name, self.twin.version, numbers), strict=True))

    def restore(self, states: Mapping[str, bytes]) -> None:
        """Puts rovers where these states, from `states` of any process, have them. Raises StateError: then none is."""
        names = list(states)
        found, wrong = read_states(list(states.values()))
        for stored in found:
            if (stored.name, stored.version) != (self.twin.name, self.twin.version):
                own = f"{self.twin.name}@{self.twin.version}"
                other = StateError(f"it is of {stored.name}@{stored.version}, not of {own}")
                wrong |= dict.fromkeys(stored.rows.tolist(), other)
            else:
                wrong |= {int(stored.rows[at]): error for at, error in self.stepper.wrong(stored.numbers).items()}
        if wrong:
            row = min(wrong)
            raise StateError(f"the state of {names[row]} cannot be continued: {wrong[row]}")
        for stored in found:
            self.put([names[row] for row in stored.rows.tolist()], stored.numbers)

    def remove(self, ids: str | Sequence[str]) -> None:
        """Forgets rovers."""
        for name in _listed(ids):
            self._free.append(self._rows.pop(name))

    def put(self, ids: Sequence[str], states: Array) -> None:
        """Puts rovers into states (rover, STATE_SIZE) that are known to be right; the array is not used elsewhere."""
        if not self._rows and len(set(ids)) == len(ids):
            self._rows = {name: row for row, name in enumerate(ids)}
            self._hold(states)
            self._free = []
            return
        rows = []
        for name in ids:
            row = self._rows.get(name)
            if row is None:
                row = self._free.pop() if self._free else len(self._rows)
                self._rows[name] = row
            rows.append(row)
        self._make_room()
        self._states[rows] = states

    def advance(
        self, ids: Sequence[str], slope_deg: Array, torque_nm: Array, brake: npt.NDArray[np.bool_], dt_s: Array
    ) -> tuple[Array, Moments]:
        """`step` with columns (rover,) that are known to be right; the states (rover, STATE_SIZE) as well."""
        rows = self._rows_of(ids)
        if len(rows) == len(self._states) and rows == list(range(len(rows))):
            return self._states, self.stepper.advance(self._states, slope_deg, torque_nm, brake, dt_s)
        states = self._states[rows]
        moments = self.stepper.advance(states, slope_deg, torque_nm, brake, dt_s)
        self._states[rows] = states
        return states, moments

    def advance_one(self, name: str, slope_deg: float, torque_nm: float, brake: bool, dt_s: float) -> Moment:
        """The same of one rover, where it lies: in a fifth of the time."""
        return self.stepper.advance_one(self._in_place, self._rows[name], slope_deg, torque_nm, brake, dt_s)

    def _hold(self, states: Array) -> None:
        self._states = np.ascontiguousarray(states)
        self._in_place = InPlace(self._states)

    def _rows_of(self, ids: Iterable[str]) -> list[int]:
        return [self._rows[name] for name in ids]

    def _make_room(self) -> None:
        """Rows are used without gaps, but for the free ones."""
        needed, room = len(self._rows) + len(self._free), len(self._states)
        if needed > room:
            grown = np.zeros((max(needed, 2 * room), STATE_SIZE))
            grown[:room] = self._states
            self._hold(grown)


def _listed(ids: str | Sequence[str]) -> Sequence[str]:
    return [ids] if isinstance(ids, str) else ids


def _column(name: str, values: Numbers, count: int) -> Array:
    column = np.asarray(values, dtype=np.float64)
    if column.shape not in ((), (count,)):
        raise InvalidValueError(name, f"{column.shape} numbers", f"one for all or one for each of {count} rovers")
    return np.broadcast_to(column, (count,))


def _flags(name: str, values: bool | Sequence[bool] | npt.NDArray[np.bool_], count: int) -> npt.NDArray[np.bool_]:
    flags = np.asarray(values)
    if flags.dtype != np.bool_:
        raise InvalidValueError(name, values, "true or false")
    if flags.shape not in ((), (count,)):
        raise InvalidValueError(name, f"{flags.shape} flags", f"one for all or one for each of {count} rovers")
    return np.broadcast_to(flags, (count,))


def _require_slopes(slope_deg: Array) -> None:
    _require("slope_deg", slope_deg, np.abs(slope_deg) < 90.0, "more than -90 and less than 90")


def _require(name: str, values: Array, right: npt.NDArray[np.bool_], allowed: str) -> None:
    if not right.all():
        raise InvalidValueError(name, float(values[int(right.argmin())]), allowed)
