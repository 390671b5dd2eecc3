"""From columns as they were recorded to canonical ones: slope frame, rear wheel, time and x from the start on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from service.datasets.alignment import FIRST_ROW, Alignment, Frame, Reference, stamp
from service.datasets.columns import BY_NAME
from service.datasets.findings import Code, Finding, UnusableFileError, reject, warn
from service.datasets.passport import Passport
from service.datasets.readers.table import Array, Lines, Samples
from service.datasets.run_table import RunEntry

SAME_TIME_S = 0.5 / BY_NAME["time_s"].scale
_SAME_PLACE_M = 0.5 / BY_NAME["rear_x_m"].scale
_PAIRS = (("rear_x_m", "rear_y_m"), ("front_x_m", "front_y_m"))
_POINTS = {
    Reference.FRONT_WHEEL: "front wheel's centre, one wheelbase ahead",
    Reference.CHASSIS: "chassis's point between the axles, half a wheelbase ahead",
}
# Of the 164 shipped runs on flat terrain, see `tests/datasets/test_alignment.py`: nine in ten stay within the first
# number along the slope; where the rover turned aside it was 0.18 m once. All stay within the second one.
_ERRORS_M = {Reference.FRONT_WHEEL: (0.004, 0.026), Reference.CHASSIS: (0.002, 0.013)}


@dataclass(frozen=True, slots=True, eq=False)
class Aligned:
    """A run in canonical columns. `shift_s` is what was taken from each time stamp; `findings` say what was done."""

    entry: RunEntry
    columns: Mapping[str, Array]
    lines: Lines
    shift_s: float
    findings: tuple[Finding, ...]


def aligned(samples: Samples, entry: RunEntry, passport: Passport, alignment: Alignment) -> Aligned:
    """The run as `alignment` says that it was recorded, brought to canonical columns.

    Numbers that are not finite, and a scenario that is not told, are left to the checks: nothing is moved then. Raises
    UnusableFileError for a frame that cannot be turned, a point that the columns contradict and a start without rows.
    """
    unchanged = Aligned(entry, samples.columns, samples.lines, 0.0, ())
    if not alignment.words() or not len(samples.lines):
        return unchanged
    if not all(np.isfinite(column).all() for column in samples.columns.values()):
        return unchanged
    told: list[str] = []
    columns = dict(samples.columns)
    if alignment.frame not in (None, Frame.SLOPE):
        columns = _turned(columns, entry, alignment.frame, told)
    if alignment.reference not in (None, Reference.REAR_WHEEL):
        _require_one_point(columns, entry, passport, alignment.reference)
        along, normal = _ERRORS_M[alignment.reference]
        told.append(
            f"positions are those of the {_POINTS[alignment.reference]}: taken as the rear wheel's, along the slope "
            f"(wrong by at most {along * 1000:g} mm in nine of ten shipped runs, heights by up to {normal * 1000:g} mm)"
        )
    return _from_start(columns, samples, entry, alignment, told)


def _turned(columns: dict[str, Array], entry: RunEntry, frame: Frame | None, told: list[str]) -> dict[str, Array]:
    """In the slope frame, x uphill; what is recorded beside positions follows them."""
    assert frame is not None
    slope = _one_slope(columns, entry, frame)
    turned = dict(columns)
    for x, y in _PAIRS:
        if x in columns:
            turned[x] = -columns[x] if frame.is_reversed else columns[x]
        if frame.is_world and x in columns and y in columns:
            along, height = turned[x], columns[y]
            turned[x] = along * np.cos(slope) + height * np.sin(slope)
            turned[y] = height * np.cos(slope) - along * np.sin(slope)
    if frame.is_reversed:
        told.append("x points downhill: turned round")
    if frame.is_world:
        told.append(f"positions are turned by the run's slope of {np.degrees(slope):g} deg")
        _turn_pitch(turned, slope, told)
    _turn_speed(turned, slope, frame, told)
    return turned


def _one_slope(columns: Mapping[str, Array], entry: RunEntry, frame: Frame) -> float:
    """In radians. Raises UnusableFileError where it changes and positions are to be turned."""
    column = columns.get("slope_deg")
    if column is None:
        return float(np.radians(entry.slope_deg or 0.0))
    if frame.is_world and np.ptp(column) > 0:
        message = (
            "the slope changes within the run, so that no one angle turns it: write x along the track and y normal "
            "to it"
        )
        raise UnusableFileError([reject(entry.file, Code.FRAME, message, column="slope_deg")])
    return float(np.radians(column[0]))


def _turn_pitch(columns: dict[str, Array], slope: float, told: list[str]) -> None:
    """A pitch that is counted from the horizontal lies about the slope; either sign is in use."""
    if "pitch_rad" in columns:
        median = float(np.median(columns["pitch_rad"]))
        base = min((0.0, slope, -slope), key=lambda each: abs(median - each))
        columns["pitch_rad"] = columns["pitch_rad"] - base
        from_what = "the slope already" if base == 0.0 else "the horizontal"
        told.append(f"pitch_rad is taken as counted from {from_what}")


def _turn_speed(columns: dict[str, Array], slope: float, frame: Frame, told: list[str]) -> None:
    """The speed as it fits the positions best: as it is, reversed, or as a horizontal one."""
    time, v = columns["time_s"], columns.get("speed_mps")
    if v is None or len(time) < 3 or not (np.diff(time) > 0).all():
        return
    ways = {"along the slope": v}
    if frame.is_world:
        ways["horizontal"] = v / np.cos(slope)
    if frame.is_reversed:
        ways |= {f"{way}, positive downhill": -speed for way, speed in ways.items()}
    travelled = columns["rear_x_m"] - columns["rear_x_m"][0]

    def misfit(speed: Array) -> float:
        steps = (speed[1:] + speed[:-1]) / 2.0 * np.diff(time)
        return float(np.square(np.concatenate([[0.0], np.cumsum(steps)]) - travelled).mean())

    chosen = min(ways, key=lambda way: misfit(ways[way]))
    columns["speed_mps"] = ways[chosen]
    told.append(f"speed_mps is taken as {chosen}, which fits the positions best")
    if frame.is_reversed:
        _turn_wheels(columns, told)


def _turn_wheels(columns: dict[str, Array], told: list[str]) -> None:
    """Wheels spin uphill at first, since motors drive them."""
    for name in ("rear_omega_radps", "front_omega_radps"):
        if name in columns:
            early = columns["time_s"] <= columns["time_s"][0] + max(1.0, 0.1 * float(np.ptp(columns["time_s"])))
            if columns[name][early].mean() < 0:
                columns[name] = -columns[name]
                told.append(f"{name} is reversed, since motors turn wheels uphill")


def _require_one_point(columns: Mapping[str, Array], entry: RunEntry, passport: Passport, reference: Reference) -> None:
    wheelbase = passport.rover.wheelbase_m
    if wheelbase is None or "front_x_m" not in columns:
        return
    ahead = float(columns["front_x_m"][0] - columns["rear_x_m"][0])
    if 0.8 < ahead / wheelbase < 1.25:
        message = (
            f"front_x_m starts {ahead:g} m ahead of rear_x_m, a whole wheelbase: rear_x_m is the rear wheel's, not "
            f"the {reference}'s; leave out --reference {reference}"
        )
        raise UnusableFileError([reject(entry.file, Code.REFERENCE, message, column="rear_x_m")])


def _from_start(
    columns: Mapping[str, Array], samples: Samples, entry: RunEntry, alignment: Alignment, told: list[str]
) -> Aligned:
    """Rows, time and x from the start on."""
    time = columns["time_s"]
    start = float(time[0]) if alignment.start == FIRST_ROW else alignment.start
    start = 0.0 if start is None else float(start)
    after = np.flatnonzero(time >= start - SAME_TIME_S) if alignment.start is not None else np.arange(len(time))
    if not len(after):
        last = stamp(float(time[-1]))
        message = f"no row at or after {stamp(start)} s, which was said to be the start; the last one is at {last} s"
        raise UnusableFileError([reject(entry.file, Code.START_TIME, message, column="time_s")])
    first = int(after[0])
    origin = _at(start, first, time, columns["rear_x_m"])
    kept = {name: column[first:] for name, column in columns.items()}
    since = kept["time_s"] - start
    kept["time_s"] = np.where(np.abs(since) < SAME_TIME_S, 0.0, since)
    for name in ("rear_x_m", "front_x_m"):
        if name in kept:
            kept[name] = kept[name] - origin
    if first:
        told.append(f"{first} rows before {stamp(start)} s are left out")
    if abs(start) > SAME_TIME_S:
        told.append(f"time is counted from {stamp(start)} s")
    if abs(origin) > _SAME_PLACE_M:
        told.append(f"x is counted from {origin:g} m")
    entry, horizon = _horizon(entry, time, start)
    told += [horizon] if horizon else []
    findings = (warn(entry.file, Code.ALIGNED, "; ".join(told)),) if told else ()
    return Aligned(entry, kept, samples.lines[first:], start, findings)


def _at(start_s: float, first: int, time_s: Array, x_m: Array) -> float:
    """x at the start: of the first row that is kept, or between it and the row before."""
    if first == 0 or time_s[first] - start_s <= SAME_TIME_S or time_s[first] <= time_s[first - 1]:
        return float(x_m[first])
    return float(np.interp(start_s, time_s[first - 1 : first + 1], x_m[first - 1 : first + 1]))


def _horizon(entry: RunEntry, time_s: Array, start_s: float) -> tuple[RunEntry, str | None]:
    """A horizon that is counted in the file's own time counts from the start too."""
    declared, end = entry.horizon_s, float(time_s[-1])
    if declared is None or abs(start_s) <= SAME_TIME_S:
        return entry, None
    tolerance = max(2.0 * float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0, 1e-3 * declared)
    if abs(end - start_s - declared) <= tolerance:
        return entry, None
    if abs(end - declared) > tolerance and abs(end - float(time_s[0]) - declared) > tolerance:
        return entry, None
    horizon = round(end - start_s, 6)
    return replace(entry, horizon_s=horizon), f"horizon_s {declared:g} becomes {horizon:g}"
