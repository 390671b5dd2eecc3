"""Checks of how a run was recorded: in which frame, of which point, from which moment on.

Each of them looks for what no run in canonical columns shows, and names the option that brings it there. What a person
has said in so many words (the slope frame, the rear wheel, a start) turns its suspicion into a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from service.datasets.alignment import FIRST_ROW, Frame, Reference, stamp
from service.datasets.checks.candidate import Array, Candidate
from service.datasets.findings import Code, Finding

# In slope-frame runs that move, heights span at most 0.05 m. Rows of another frame rise with x.
LEAST_RISE_M = 0.03
LESS_WHEN_TURNED = 0.5
MOST_RISE_M = 0.15
LEAST_SLOPE_DEG = 3.0
"""A wheelbase at an angle of three degrees rises 7 cm; pitch never reaches half of that."""

MUCH_MOTOR = 2.0
HOLDS_DEG = 29.0
SLIDES_M = -0.3
"""No shipped run slides this far where its motors push twice as hard as gravity pulls and the soil holds."""

STILL_M = 2e-3
STILL_S = 0.5
"""Released on a slope or driven, all shipped runs that move at all have moved two millimetres within 0.27 s."""

SETTLED_M = 2e-5
WHEELS_STILL_RAD_S = 0.02
WHEELS_SETTLED_RAD_S = 1e-3
WHEELS_STILL_S = 0.2
"""Where motors drive, all shipped runs turn a wheel this fast within 0.05 s."""

FEWEST_ROWS = 4
"""Of coarse rows one or two may look like standing still."""

THEN_MOVES_M = 0.02
START_WINDOW_S = 0.02
START_SPEED_M_S = 0.15
SURELY_M_S = 0.25
"""Against gravity, above what a released rover may have by chance, and above what any may have."""
START_SPIN_RAD_S = 0.1
SPIN_UP_RAD_S2 = 400.0
"""Torque of a wheel (100 N m) over its inertia (0.25 kg m2)."""
SLIDES_M_S = 0.35
"""A parked rover creeps downhill: at up to 0.18 m/s in the shipped runs."""

HIGH_RADII = 1.5
LEAST_TRAVEL_M = 0.01
POINT_TOLERANCE = 0.02
"""In wheelbases: 2.6 cm for VIPER."""


def frame(run: Candidate) -> Iterator[Finding]:
    """Positions along the slope and normal to it, x uphill. (Where the slope changes, heights tell nothing of that.)"""
    slope_deg = run.acting("slope_deg")
    if len(run.time_s) < 2:
        return
    slope = float(np.radians(slope_deg[0]))
    one_slope = np.ptp(slope_deg) == 0
    found = (_by_rise(run, slope) if one_slope else None) or _by_wheels(run, slope)
    found = found or (_by_origin(run, slope) if one_slope else None)
    if found is not None:
        wanted, why = found
        yield _say(run, run.said.frame is Frame.SLOPE)(Code.FRAME, f"{why}; {_frame_remedy(run, wanted)}", at=0,
                                                       column="rear_x_m")  # fmt: skip
    elif one_slope and run.said.frame not in (None, Frame.SLOPE) and np.ptp(run.columns["rear_y_m"]) > MOST_RISE_M:
        message = f"heights span {np.ptp(run.columns['rear_y_m']):.3g} m once turned; {_frame_remedy(run, Frame.SLOPE)}"
        yield run.reject(Code.FRAME, message, column="rear_y_m")
    elif (way_m := _downhill_in_spite_of_motors(run)) < SLIDES_M:
        yield _downhill(run, way_m)


def _downhill(run: Candidate, way_m: float) -> Finding:
    message = (
        f"goes {way_m:.3g} m, downhill, while the motors push more than {MUCH_MOTOR:g} times as hard as gravity pulls"
    )
    if run.said.frame is not None:
        return run.reject(Code.FRAME, f"{message}; {_frame_remedy(run, Frame.SLOPE)}", column="rear_x_m")
    return run.warn(Code.FRAME, f"{message}; {_frame_remedy(run, Frame.SLOPE_DOWNHILL)}", column="rear_x_m")


def _by_rise(run: Candidate, slope: float) -> tuple[Frame, str] | None:
    """Heights that rise with x as a slope does, and are level once turned by it."""
    x, y = run.columns["rear_x_m"], run.columns["rear_y_m"]
    rise = float(np.ptp(y))
    if rise < LEAST_RISE_M:
        return None
    turned = {
        Frame.WORLD: float(np.ptp(y * np.cos(slope) - x * np.sin(slope))),
        Frame.WORLD_DOWNHILL: float(np.ptp(y * np.cos(slope) + x * np.sin(slope))),
    }
    wanted = min(turned, key=lambda each: turned[each])
    if turned[wanted] > LESS_WHEN_TURNED * rise:
        return None
    return wanted, (
        f"heights span {rise:.3g} m, and {turned[wanted]:.2g} m once turned by the slope of {np.degrees(slope):g} deg: "
        "positions lie in a world frame (x horizontal, height upwards)"
    )


def _by_wheels(run: Candidate, slope: float) -> tuple[Frame, str] | None:
    """Where the front wheel stands as seen from the rear one."""
    if not {"front_x_m", "front_y_m"} <= set(run.columns):
        return None
    ahead = float(run.columns["front_x_m"][0] - run.columns["rear_x_m"][0])
    above = float(run.columns["front_y_m"][0] - run.columns["rear_y_m"][0])
    distance = float(np.hypot(ahead, above))
    wheelbase = run.passport.rover.wheelbase_m
    if wheelbase is None or not 0.8 < distance / wheelbase < 1.25:
        return None
    angle = float(np.degrees(np.arctan2(above, abs(ahead))))
    slope_deg = float(np.degrees(slope)) * (1.0 if ahead > 0 else -1.0)
    tilted = abs(slope_deg) > LEAST_SLOPE_DEG and abs(angle - slope_deg) < 0.5 * abs(angle)
    if not tilted and ahead > 0:
        return None
    where = f"{distance:.4g} m {'ahead of' if ahead > 0 else 'behind'} the rear wheel, at {angle:.3g} deg"
    return _NAMED[tilted, ahead < 0], f"the front wheel stands {where}, by the signs of x and height"


_NAMED = {
    (False, True): Frame.SLOPE_DOWNHILL,
    (True, False): Frame.WORLD,
    (True, True): Frame.WORLD_DOWNHILL,
}


def _by_origin(run: Candidate, slope: float) -> tuple[Frame, str] | None:
    """A wheel above the origin of a slope starts beside the origin of a world frame."""
    x, y = (float(run.columns[name][0]) for name in ("rear_x_m", "rear_y_m"))
    if abs(np.degrees(slope)) < LEAST_SLOPE_DEG or y <= 0 or abs(x) < LEAST_TRAVEL_M:
        return None
    for wanted, sign in ((Frame.WORLD, -1.0), (Frame.WORLD_DOWNHILL, 1.0)):
        if abs(x / y / (sign * np.tan(slope)) - 1.0) < 0.02 and 0.5 < np.hypot(x, y) / _radius(run) < 1.3:
            return wanted, (
                f"the wheel starts at {x:.4g} m and {y:.4g} m high, as one that stands normal to a slope of "
                f"{np.degrees(slope):g} deg does in a world frame"
            )
    return None


def _frame_remedy(run: Candidate, wanted: Frame) -> str:
    if run.said.frame not in (None, Frame.SLOPE):
        others = ", ".join(each for each in Frame if each is not run.said.frame)
        return f"so they were not in --frame {run.said.frame}, which turned them: leave it out, or pass one of {others}"
    if wanted.is_reversed:
        return f"if x grows downhill, pass --frame {wanted} (a rover that faces downhill has a negative slope_deg)"
    return f"pass --frame {wanted}"


def _downhill_in_spite_of_motors(run: Candidate) -> float:
    """How far it goes, m, while the motors are much stronger than gravity; 0 where that says nothing."""
    if run.said.frame in (Frame.SLOPE, Frame.WORLD):
        return 0.0
    slope = np.radians(run.acting("slope_deg"))
    push = (run.passport.rover.wheels or 4) * run.acting("torque_nm") / _radius(run)
    pull = run.entry.mass_kg * run.passport.gravity_m_s2 * np.abs(np.sin(slope))
    strong = (push > 0) & (push > MUCH_MOTOR * pull) & (np.abs(slope) < np.radians(HOLDS_DEG))
    if "brake" in run.columns:
        strong &= run.columns["brake"] == 0
    return float(np.diff(run.columns["rear_x_m"])[strong[:-1]].sum())


def reference(run: Candidate) -> Iterator[Finding]:
    """The height at the start is a wheel's."""
    height, radius = float(run.columns["rear_y_m"][0]), _radius(run)
    mass_centre = run.passport.rover.centre_of_mass_above_surface_m
    if mass_centre is None or not (0.8 < height / mass_centre < 1.25 and height > HIGH_RADII * radius):
        return
    message = (
        f"starts {height:g} m above the surface, where the centre of mass is ({mass_centre:g} m), not a wheel of "
        f"radius {radius:g} m: record the rear wheel's centre (in Chrono GetWheel(V_LB)->GetPos()), or the "
        f"chassis's (GetChassis()->GetPos(), level with the axles) and pass --reference {Reference.CHASSIS}"
    )
    yield _say(run, run.said.reference is Reference.REAR_WHEEL)(Code.REFERENCE, message, at=0, column="rear_y_m")


def ahead_of_origin(run: Candidate) -> tuple[str, Reference] | None:
    """Which point of the rover stands where x starts, if the rear wheel stands at the origin; None: no other one."""
    wheelbase = run.passport.rover.wheelbase_m
    if wheelbase is None:
        return None
    first = float(run.columns["rear_x_m"][0]) / wheelbase
    points = {
        1.0: (f"one wheelbase ({wheelbase:g} m)", Reference.FRONT_WHEEL),
        0.5: (f"half a wheelbase ({wheelbase / 2:g} m)", Reference.CHASSIS),
    }
    return next((point for at, point in points.items() if abs(first - at) < POINT_TOLERANCE), None)


def start(run: Candidate) -> Iterator[Finding]:
    """The first row is the moment when motors are switched on: not before, and not long after."""
    if len(run.time_s) < 2 or not (np.diff(run.time_s) > 0).all():
        return
    settled = settled_until(run)
    if settled is not None:
        until, how = settled
        since = until + run.shift_s
        message = (
            f"{how} until {stamp(since)} s of the file's time, and then does: if the motors were switched on "
            f"then, pass {run.said.at(since)} (else the time at which they were)"
        )
        explicit = run.said.start is not None and run.said.start != FIRST_ROW
        yield _say(run, explicit)(Code.SETTLING, message, at=int(np.searchsorted(run.time_s, until)), column="time_s")
    moving = moves_at_start(run)
    if moving is not None:
        what, is_sure = moving
        message = (
            f"{what}: a run begins at rest, when the motors are switched on, and nothing can be learned from "
            "one whose beginning is cut off; add the rows before, and pass --start with the time of that moment"
        )
        yield _say(run, not is_sure)(Code.MOVING_START, message, at=0, column="rear_x_m")


def settled_until(run: Candidate) -> tuple[float, str] | None:
    """How long the rover stands at first though its motors are on, s, and what shows it; None where it does not."""
    driven = run.acting("torque_nm") > 0
    if "brake" in run.columns:
        driven = driven & (run.columns["brake"] == 0)
    if not driven[0]:
        return None
    x = run.columns["rear_x_m"]
    if np.abs(x - x[0]).max() < THEN_MOVES_M:
        return None
    spins = [np.abs(run.columns[n]) for n in ("rear_omega_radps", "front_omega_radps") if n in run.columns]
    ways: list[tuple[str, Array, float, float, float]] = []
    if spins:
        ways.append(("no wheel turns", np.max(spins, axis=0), WHEELS_STILL_RAD_S, WHEELS_SETTLED_RAD_S, WHEELS_STILL_S))
    ways.append(("the rover does not move", np.abs(x - x[0]), STILL_M, SETTLED_M, STILL_S))
    for how, departs, still, settled, least in ways:
        stands = _while(departs <= still)
        if stands < FEWEST_ROWS or stands == len(x) - 1 or not driven[: stands + 1].all():
            continue
        until = float(run.time_s[_knee(departs, stands, settled)])
        if until - run.time_s[0] >= least:
            return until, how
    return None


def _while(holds: npt.NDArray[np.bool_]) -> int:
    """Index of the last row up to which it holds."""
    ends = np.flatnonzero(~holds)
    return len(holds) - 1 if not len(ends) else max(0, int(ends[0]) - 1)


def _knee(departs: Array, stands: int, settled: float) -> int:
    """The last row, up to `stands`, that departs no more than those before did while the rover stood."""
    half = departs[stands // 4 : max(stands // 4 + 1, 3 * stands // 4)]
    middle = float(np.median(half))
    noise = float(np.abs(half - middle).max())
    near = np.flatnonzero(np.abs(departs[: stands + 1] - middle) <= max(settled, 1.5 * noise))
    return int(near[-1]) if len(near) else stands


def moves_at_start(run: Candidate) -> tuple[str, bool] | None:
    """What shows that the rover was under way already, and whether that is sure; None where nothing does."""
    # the first row may be that after the first step
    late = max(0.0, float(run.time_s[0]))
    late = late if late <= 1.5 * float(np.median(np.diff(run.time_s))) else 0.0
    for name in ("rear_omega_radps", "front_omega_radps"):
        if name in run.columns and abs(spin := float(run.columns[name][0])) > START_SPIN_RAD_S + SPIN_UP_RAD_S2 * late:
            return f"{name} is {spin:.3g} rad/s in the first row", True
    pull = -float(np.sin(np.radians(run.acting("slope_deg")[0])))
    speeds = _start_speeds(run)

    def all_above(against_m_s: float) -> bool:
        return all(
            abs(speed) > (SLIDES_M_S if speed * pull > 0 else against_m_s) + run.passport.gravity_m_s2 * (late + window)
            for speed, window in speeds
        )

    if not all_above(START_SPEED_M_S):
        return None
    return f"moves at {speeds[0][0]:.3g} m/s in the first row", all_above(SURELY_M_S)


def _start_speeds(run: Candidate) -> list[tuple[float, float]]:
    """Speeds at first, m/s, by positions and as recorded; each with how long it may have risen by then, s."""
    time, x = run.time_s, run.columns["rear_x_m"]
    last = min(max(1, int(np.searchsorted(time, time[0] + START_WINDOW_S))), len(time) - 1)
    window = float(time[last] - time[0])
    blur = 1e-5 * float(np.abs(x).max()) / window
    speed = float(x[last] - x[0]) / window
    speeds = [(float(np.sign(speed)) * max(0.0, abs(speed) - blur), window)]
    if "speed_mps" in run.columns:
        speeds.append((float(run.columns["speed_mps"][0]), 0.0))
    return speeds


def _radius(run: Candidate) -> float:
    return run.passport.rover.wheel_radius_m


def _say(run: Candidate, explicit: bool) -> Callable[..., Finding]:
    return run.warn if explicit else run.reject
