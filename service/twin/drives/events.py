"""What happens on the way: the rover sticks, slides, goes on, passes the end of the track, arrives.

Found at the way's own times and then between two of them, where the speed is taken as a quadratic that fits both ends
and the way between: right to a millisecond, and the same whatever points an answer has.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
import numpy.typing as npt

from service.learning.doubt.outcomes import LATE_SPEED_M_S as SLOW_M_S
from service.twin.drives.way import Way, crossing_of_speed, crossing_of_way

STICKS_AFTER_S, SLIDES_AFTER_S, GOES_ON_AFTER_S = 1.0, 0.5, 0.5
MOST_EVENTS = 100


class EventName(StrEnum):
    """Sticks: with motors on and no brake, slower than 0.015 m/s for a second or more. Slides: goes back faster than
    that for half a second or more. Goes on: forwards again, faster than that, for half a second or more. Passes: its
    middle passes the last knot of the track. Arrives: the rear wheel is where the drive was to end.
    """

    STICKS = "sticks"
    SLIDES = "slides"
    GOES_ON = "goes_on"
    PASSES = "passes"
    ARRIVES = "arrives"


@dataclass(frozen=True, slots=True)
class Event:
    """What happens, when it begins (s), and where the rear wheel is then (m along the track)."""

    event: EventName
    time_s: float
    x_m: float


class _Goes(IntEnum):
    """How a rover goes: back, slowly with its motors on, slowly without, forwards."""

    BACK = 0
    SLOWLY = 1
    IDLY = 2
    FORWARDS = 3


@dataclass(frozen=True, slots=True)
class _Spell:
    """A time in which it goes in one of these ways."""

    goes: _Goes
    time_s: float
    x_m: float
    until_s: float

    @property
    def seconds(self) -> float:
        return self.until_s - self.time_s


def events_of(
    way: Way, driven: npt.NDArray[np.bool_], ahead_m: float, last_m: float | None, arrived: bool
) -> tuple[list[Event], int]:
    """What happens on a way at its own times, in order, and how many events there are beyond the first hundred.

    `driven` (time,) says whether motors drive from each time on; the rover's middle is `ahead_m` of its rear wheel,
    `last_m` is the last knot (None: a track without an end). Whoever `arrived` did so at the last time.
    """
    found = list(_troubles(_spells(way, driven))) if _may_be_trouble(way) else []
    if last_m is not None and (passes := _passing(way, last_m - ahead_m)) is not None:
        found = sorted([*found, passes], key=lambda each: each.time_s)
    kept, left_out = found[:MOST_EVENTS], max(len(found) - MOST_EVENTS, 0)
    if arrived:
        kept.append(Event(EventName.ARRIVES, float(way.time_s[-1]), float(way.motion.x_m[-1])))
    return kept, left_out


def _may_be_trouble(way: Way) -> bool:
    """Whether it is slow, or goes back, for half a second in one go: seldom so, and quickly seen."""
    time, fast = way.time_s, way.motion.speed_m_s > SLOW_M_S
    slow = np.flatnonzero(~fast)
    if not slow.size:
        return False
    before, after = max(int(slow[0]) - 1, 0), min(int(slow[-1]) + 1, len(time) - 1)
    if time[after] - time[before] < SLIDES_AFTER_S:
        return False
    forwards = np.flatnonzero(fast)
    if not forwards.size:
        return True
    gaps = np.flatnonzero(forwards[1:] - forwards[:-1] > 1)
    inside = bool((time[forwards[gaps + 1]] - time[forwards[gaps]] >= SLIDES_AFTER_S).any())
    return inside or bool(time[forwards[0]] >= SLIDES_AFTER_S or time[-1] - time[forwards[-1]] >= SLIDES_AFTER_S)


def _troubles(spells: Iterator[_Spell]) -> Iterator[Event]:
    """Sticking, sliding and what ends it."""
    trouble: EventName | None = None
    for spell in spells:
        name: EventName | None = None
        if spell.goes is _Goes.SLOWLY and spell.seconds >= STICKS_AFTER_S:
            name = EventName.STICKS
        elif spell.goes is _Goes.BACK and spell.seconds >= SLIDES_AFTER_S:
            name = EventName.SLIDES
        elif spell.goes is _Goes.FORWARDS and trouble is not None and spell.seconds >= GOES_ON_AFTER_S:
            yield Event(EventName.GOES_ON, spell.time_s, spell.x_m)
            trouble = None
        if name is not None and name is not trouble:
            yield Event(name, spell.time_s, spell.x_m)
            trouble = name


def _spells(way: Way, driven: npt.NDArray[np.bool_]) -> Iterator[_Spell]:
    speed, x, time = way.motion.speed_m_s, way.motion.x_m, way.time_s
    goes = np.where(driven, int(_Goes.SLOWLY), int(_Goes.IDLY))
    goes[speed > SLOW_M_S] = _Goes.FORWARDS
    goes[speed < -SLOW_M_S] = _Goes.BACK
    changes = np.flatnonzero(goes[1:] != goes[:-1]) + 1
    began, place = float(time[0]), float(x[0])
    now = _Goes(int(goes[0]))
    for at in changes.tolist():
        then = _Goes(int(goes[at]))
        level = _level_between(now, then)
        if level is None:
            when, where = float(time[at]), float(x[at])
        else:
            step, both = float(time[at] - time[at - 1]), slice(at - 1, at + 1)
            share, where = crossing_of_speed(x[both], speed[both], step, level)
            when = float(time[at - 1]) + share * step
        yield _Spell(now, began, place, when)
        now, began, place = then, when, where
    yield _Spell(now, began, place, float(time[-1]))


def _level_between(now: _Goes, then: _Goes) -> float | None:
    """The speed that is crossed on the way from one to the other; None where only the motors change."""
    if _Goes.BACK in (now, then):
        return -SLOW_M_S if then is not _Goes.FORWARDS else SLOW_M_S
    return SLOW_M_S if _Goes.FORWARDS in (now, then) else None


def _passing(way: Way, distance_m: float) -> Event | None:
    """When the rear wheel is at a distance for the first time, if it begins before it."""
    x = way.motion.x_m
    beyond = np.flatnonzero(x >= distance_m)
    if not beyond.size or beyond[0] == 0:
        return None
    at = int(beyond[0])
    both = slice(at - 1, at + 1)
    step = float(way.time_s[at] - way.time_s[at - 1])
    share = crossing_of_way(x[both], way.motion.speed_m_s[both], step, distance_m)
    return Event(EventName.PASSES, float(way.time_s[at - 1]) + share * step, distance_m)
