"""The answers to questions: trajectory, events, summary, band and domain, from as few drives of the engine as can be.

One drive gives points and summary, one or two more the probabilities; a band takes two to six, and so does the interval
of an arrival. Drives that are known to be needed go together: side by side where the engine can (`Engine.along`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from service.errors import InvalidValueError
from service.learning.doubt.doubt import HIGHEST_LEVEL, LOWEST_LEVEL, Doubt
from service.learning.doubt.ending import Ending
from service.learning.doubt.meeting import Meeting
from service.learning.doubt.outcomes import Class
from service.learning.drive.engine import Engine, Motion
from service.physics.scenario import Array, Positions
from service.tracing import span
from service.twin.drives import summary as numbers
from service.twin.drives.events import Event, events_of
from service.twin.drives.question import DriveQuestion, Driver, Told, driver_of
from service.twin.drives.stretches import DriveDomain, domain_of
from service.twin.drives.summary import OUTCOMES, Arrival, DriveOutcome, DriveSummary, Probabilities
from service.twin.drives.way import Rover, TimedRoute, Way, drive_many, own_times
from service.twin.moment import slip_ratios
from service.twin.prediction import Frame, NonFiniteError, PredictionBand
from service.twin.scenario import sample_times
from service.twin.twin import Twin

Column = npt.NDArray[Any]

_USUAL_LEVEL = 0.9
_POINTS_AT_ONCE = 32_768  # of drives that go together: what they need stays at some megabytes
_LOOK_ON = 1.25  # how much longer than its arrival a drive is looked at for the latest one, at first


@dataclass(frozen=True, slots=True)
class Wanted:
    """At which times (`times_s`, or each `dt_s`) and with which parts a drive is answered."""

    dt_s: float = 0.05
    times_s: Array | None = None
    frame: Frame = Frame.SLOPE
    band: bool = False
    band_level: float = _USUAL_LEVEL
    wheel_speed: bool = False

    def times_until(self, horizon_s: float) -> Array:
        """Shape (time,), s."""
        return sample_times(horizon_s, self.dt_s) if self.times_s is None else self.times_s


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """One drive. `trajectory` maps names to columns (time,): time_s, x_m, y_m (world frame: z_m), speed_m_s, slope_deg,
    torque_nm, brake (bool), slip_ratio, on request rear_wheel_speed_rad_s and front_wheel_speed_rad_s.

    `along_m` are the positions in the slope frame whatever the frame is, (time,) each. `events_left_out` counts those
    beyond a hundred.
    """

    question: DriveQuestion
    frame: Frame
    trajectory: dict[str, Column]
    along_m: tuple[Array, Array]
    events: tuple[Event, ...]
    events_left_out: int
    summary: DriveSummary
    domain: DriveDomain
    band: PredictionBand | None = None

    @property
    def position_names(self) -> tuple[str, str]:
        """The two columns of the trajectory that say where the rover is."""
        return ("x_m", "y_m") if self.frame is Frame.SLOPE else ("x_m", "z_m")

    def world_m(self) -> tuple[Array, Array]:
        """Horizontal and up, (time,) each, whatever the frame is."""
        if self.frame is Frame.WORLD:
            return self.trajectory["x_m"], self.trajectory["z_m"]
        return self.question.ground.world(*self.along_m)


def drive(twin: Twin, question: DriveQuestion, wanted: Wanted) -> Drive:
    """What a twin says of a drive.

    Raises InvalidValueError for a twin that cannot drive, and for a band in the world frame, of a version without one
    or at a level that is not 0.5 to 0.99; NonFiniteError instead of answering with NaN or infinity.
    """
    (found,) = drives(twin, [question], wanted)
    if isinstance(found, NonFiniteError):
        raise found
    return found


def drives(twin: Twin, questions: Sequence[DriveQuestion], wanted: Wanted) -> list[Drive | NonFiniteError]:
    """`drive` of each question, to the bit and sooner: those whose controls change at the same times go side by side.

    Raises InvalidValueError as `drive` does; the error of one question takes the place of its answer.
    """
    driver, found = require_driver(twin, wanted), []
    with span("drive", model=twin.name, version=twin.version):
        waiting: list[_Answer] = []
        points = 0
        for question in questions:
            waiting.append(_Answer(twin, question, wanted, Rover.of(driver, question)))
            points += len(waiting[-1].time_s)
            if points > _POINTS_AT_ONCE:
                found += _answered(driver.engine, waiting)
                waiting, points = [], 0
        return found + _answered(driver.engine, waiting)


def _answered(engine: Engine, answers: Sequence[_Answer]) -> list[Drive | NonFiniteError]:
    """First each drive as it most probably is; then, of all, those with offsets that are needed in any case."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused
        first = drive_many([each.first() for each in answers], engine.along)
        for each, motions in zip(answers, first, strict=True):
            each.begin(motions)
        doubtful = drive_many([each.doubtful() for each in answers], engine.ways_along)
        for each, ways_m in zip(answers, doubtful, strict=True):
            each.know(ways_m)
        return [each.found() for each in answers]


def require_driver(twin: Twin, wanted: Wanted) -> Driver:
    """The model that drives. Raises InvalidValueError for what a twin can answer to no drive at all."""
    driver = driver_of(twin)
    if wanted.band and not isinstance(twin.band_in(wanted.frame), Doubt):
        none = f"wheel_speed; {twin.name}@{twin.version} has no band around drives"
        raise InvalidValueError("include", "band", none)
    if wanted.band and not LOWEST_LEVEL <= wanted.band_level <= HIGHEST_LEVEL:
        raise InvalidValueError("band_level", wanted.band_level, f"{LOWEST_LEVEL:g} to {HIGHEST_LEVEL:g}")
    return driver


class _Answer:
    """One answer in the making."""

    def __init__(self, twin: Twin, question: DriveQuestion, wanted: Wanted, rover: Rover) -> None:
        self._twin, self._question, self._wanted, self._rover = twin, question, wanted, rover
        self._ahead_m = 0.5 * rover.driver.prior.rover.wheelbase_m
        self._doubt = twin.doubt
        self._known: dict[tuple[float, int], Array] = {}  # x by offset and by which times
        own, shown = self._own_s, self._shown_s = own_times(question), wanted.times_until(question.horizon_s)
        self.time_s = own if shown is own else np.union1d(own, shown)
        """All times of the drive, (time,)."""

    def first(self) -> list[TimedRoute]:
        """The drive as it most probably is; none if it ends where it arrives, which nobody knows before."""
        return [(self._rover.route(), self.time_s)] if self._question.until_distance_m is None else []

    def begin(self, motions: Sequence[Motion]) -> None:
        """Takes the motion of the first route; without one drives until it arrives."""
        self._arrived: float | None = None
        if (distance := self._question.until_distance_m) is None:
            way = Way(self.time_s, motions[0])
        else:
            way, self._arrived = self._rover.until(distance, self.time_s, self._own_s)
        if (end := self._arrived) is not None:
            self._shown_s, self._own_s = (np.append(each[each < end], end) for each in (self._shown_s, self._own_s))
        self._own = way.rows(self._own_s)
        self._shown = self._own if self._shown_s is self._own_s else way.rows(self._shown_s)
        self._told = Told.at(self._question.controls, self._own_s)
        self._finite = self._own.is_finite() and (self._shown is self._own or self._shown.is_finite())

    def doubtful(self) -> list[TimedRoute]:
        """The drives with offsets that are needed in any case."""
        self._doubtful: list[TimedRoute] = []
        if self._doubt is None or not self._finite:
            return self._doubtful
        ending, band = self._ending, self._wanted.band
        whole = band and self._shown is self._own  # all offsets at the same times: then they go together
        times = self._own_s if whole else ending.time_s
        found = [(each, times) for each in self._doubt.drive_reaches(ending, self._scales)]
        if band:
            found += [(each, self._shown_s) for each in self._doubt.drive_sides(self._wanted.band_level, self._scales)]
        self._doubtful = [(self._rover.route(offset), time_s) for offset, time_s in found]
        return self._doubtful

    def know(self, ways_m: Sequence[Array]) -> None:
        """Takes the x (time,) of each of these."""
        for (route, time_s), x_m in zip(self._doubtful, ways_m, strict=True):
            self._known[route.offset, id(time_s)] = x_m
            if time_s is self._own_s:
                self._known[route.offset, id(self._ending.time_s)] = x_m[self._ending.rows]

    def _ways(self, offsets: Sequence[float], time_s: Array) -> Sequence[Array] | Array:
        """The x (time,) with each of some offsets, at times of which none is asked for anew."""
        found = [x_m for each in offsets if (x_m := self._known.get((each, id(time_s)))) is not None]
        return found if len(found) == len(offsets) else self._rover.ways(offsets, time_s)

    def found(self) -> Drive | NonFiniteError:
        """The answer, or why there is none."""
        if not self._finite:
            return self._not_finite()
        shown, own, ground = self._shown, self._own, self._question.ground
        trajectory, arrives = self._columns(shown), self._arrived is not None
        events, left_out = events_of(own, self._told.driven, self._ahead_m, ground.end_m, arrives)
        slopes = trajectory["slope_deg"] if shown is own else self._slopes_deg(own)
        found = Drive(
            question=self._question,
            frame=self._wanted.frame,
            trajectory=trajectory,
            along_m=(shown.motion.x_m, shown.motion.y_m),
            events=tuple(events),
            events_left_out=left_out,
            summary=self._summary(shown, self._arrived),
            domain=domain_of(self._twin.domain, self._question.mass_kg, own, self._told, slopes),
            band=self._band(shown) if self._wanted.band else None,
        )
        return found if _is_finite(found) else self._not_finite()

    def _columns(self, way: Way) -> dict[str, Column]:
        motion, rover, frame = way.motion, self._rover.driver.prior.rover, self._wanted.frame
        told = self._told if way is self._own else Told.at(self._question.controls, way.time_s)
        where = {"x_m": motion.x_m, "y_m": motion.y_m}
        if frame is Frame.WORLD:
            where = dict(zip(("x_m", "z_m"), self._question.ground.world(motion.x_m, motion.y_m), strict=True))
        rear, front = motion.rear_wheel_rad_s, motion.front_wheel_rad_s
        columns: dict[str, Column] = {
            "time_s": way.time_s,
            **where,
            "speed_m_s": motion.speed_m_s,
            "slope_deg": self._slopes_deg(way),
            "torque_nm": told.torque_nm,
            "brake": told.brake,
            "slip_ratio": slip_ratios(rover.wheel_radius_m, motion.speed_m_s, rear, front),
        }
        wheels: dict[str, Column] = {"rear_wheel_speed_rad_s": rear, "front_wheel_speed_rad_s": front}
        return columns | (wheels if self._wanted.wheel_speed else {})

    def _slopes_deg(self, way: Way) -> Array:
        return self._question.ground.slopes_at(way.motion.x_m + self._ahead_m)

    @cached_property
    def _meeting(self) -> Meeting:
        motion = self._own.motion
        told = self._told
        mass = self._question.mass_kg
        return Meeting(mass, self._own.time_s, motion.x_m, motion.slope_rad, told.torque_nm, told.brake)

    @cached_property
    def _scales(self) -> Array:
        assert self._doubt is not None
        return self._doubt.drive_scales(self._meeting)

    @cached_property
    def _ending(self) -> Ending:
        return Ending.of(self._meeting)

    def _summary(self, shown: Way, arrived: float | None) -> DriveSummary:
        own, ground = self._own, self._question.ground
        chances = self._chances()
        arrival = self._arrival(arrived)
        x = own.motion.x_m
        slope, place = ground.steepest(float(x.min()) + self._ahead_m, float(x.max()) + self._ahead_m)
        return DriveSummary(
            outcome=numbers.outcome_of(own, self._told) if chances is None else _likeliest(chances),
            probabilities=chances,
            arrival_time_s=arrival.time_s,
            arrival_earliest_s=arrival.earliest_s,
            arrival_latest_s=arrival.latest_s,
            motor_energy_j=numbers.motor_energy_j(self._rover.driver.prior.rover, own, self._told),
            steepest_slope_deg=slope,
            steepest_at_m=place,
            final_x_m=float(shown.motion.x_m[-1]),
            final_y_m=float(shown.motion.y_m[-1]),
            distance_m=numbers.distance_m(own),
            mean_speed_m_s=numbers.mean_speed_m_s(own),
            duration_s=float(own.time_s[-1]),
        )

    def _chances(self) -> Probabilities | None:
        if self._doubt is None:
            return None
        found = self._doubt.drive_probabilities(self._ways, self._meeting, self._scales, self._ending)
        return Probabilities(*(float(found[each]) for each in (Class.CLIMBS, Class.STALLS, Class.SLIDES)))

    def _band(self, shown: Way) -> PredictionBand:
        low, high, y_low, y_high = self._edges(shown.time_s, shown.motion.x_m, shown.motion.y_m)
        return PredictionBand(self._wanted.band_level, low, high, y_low, y_high)

    def _edges(self, time_s: Array, x_m: Array, y_m: Array) -> tuple[Array, Array, Array, Array]:
        """Of the band at times, (time,) each."""
        assert self._doubt is not None
        edges = self._doubt.drive_edges(
            self._ways,
            self._meeting,
            self._wanted.band_level,
            Positions(x_m[None], y_m[None]),
            time_s=time_s,
            scales=self._scales,
            possible=self._possible(time_s),
        )
        return edges.x_low_m[0], edges.x_high_m[0], edges.y_low_m[0], edges.y_high_m[0]

    def _possible(self, time_s: Array) -> tuple[Array, Array]:
        """Between which x (m) a rover must be that neither falls faster than freely nor outruns idling motors."""
        assert self._doubt is not None
        lowest, highest = (np.sin(np.radians(each)) for each in self._question.ground.extremes_deg())
        speed = self._question.start_speed_m_s or 0.0
        return self._doubt.possible_ways((float(lowest), float(highest)), speed, time_s)

    def _arrival(self, arrived: float | None) -> Arrival:
        """The interval is that of the band: from where its upper edge arrives to where its lower one does."""
        distance, horizon = self._question.until_distance_m, self._question.horizon_s
        if distance is None or self._doubt is None:
            return Arrival(arrived, None, None)
        own = own_times(self._question)
        until = horizon if arrived is None else min(horizon, _LOOK_ON * arrived + 1.0)
        while True:
            times = own[: int(np.searchsorted(own, until, side="right"))]
            centre = self._rover.at(times).motion
            low, high, _, _ = self._edges(times, centre.x_m, centre.y_m)
            earliest, latest = (_first_at(edge, times, distance) for edge in (high, low))
            if latest is not None or until >= horizon:
                return Arrival(arrived, earliest, latest)
            until = min(2.0 * until, horizon)

    def _not_finite(self) -> NonFiniteError:
        return NonFiniteError(f"{self._twin.name}@{self._twin.version} has no finite answer for this drive")


def _is_finite(found: Drive) -> bool:
    """Whether band and summary are."""
    columns: list[Array] = [] if found.band is None else list(found.band.columns().values())
    scalars = (found.summary.motor_energy_j, found.summary.distance_m, found.summary.mean_speed_m_s)
    return all(np.isfinite(each).all() for each in columns) and all(map(math.isfinite, scalars))


def _likeliest(chances: Probabilities) -> DriveOutcome:
    """The first of the most probable ones."""
    each: Mapping[DriveOutcome, float] = {outcome: getattr(chances, outcome.value) for outcome in OUTCOMES.values()}
    return max(each, key=lambda outcome: each[outcome])


def _first_at(edge_m: Array, time_s: Array, distance_m: float) -> float | None:
    """When an edge first reaches a distance, on straight lines between its times."""
    reached = np.flatnonzero(edge_m >= distance_m)
    if not reached.size:
        return None
    at = int(reached[0])
    if at == 0:
        return float(time_s[0])
    share = (distance_m - edge_m[at - 1]) / max(edge_m[at] - edge_m[at - 1], 1e-12)
    return float(time_s[at - 1] + share * (time_s[at] - time_s[at - 1]))
