"""Checks of single values: finite, in a unit that can be, in a plausible range."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from service.datasets.checks.candidate import Candidate
from service.datasets.columns import BY_NAME
from service.datasets.findings import Code, Finding
from service.datasets.run_table import FILE as RUN_TABLE

_OTHERWISE = {
    "torque_nm": "locked wheels are a column brake with 1, and motors that are off have 0",
    "time_s": "--start 0 leaves out rows before 0 s, if motors were switched on then; --start first-row counts from "
    "the first row; or another unit or another column?",
    "rear_x_m": "another unit or another column? another origin: --start first-row counts from the first row",
    "rear_y_m": "another unit or another column? heights of a world frame: --frame world",
}
_LENGTH_UNITS = {"millimetres": 1000.0, "centimetres": 100.0}


def finite(run: Candidate) -> Iterator[Finding]:
    """Every value is a finite number; the first that is not, per column, and how many."""
    for name, column in run.columns.items():
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            message = f"{column[bad[0]]} is not finite ({len(bad)} of {len(column)} rows)"
            yield run.reject(Code.NON_FINITE, message, at=int(bad[0]), column=name)


def told(run: Candidate) -> Iterator[Finding]:
    """Slope and torque are told by the run's entry or by its rows."""
    for name in ("slope_deg", "torque_nm"):
        if getattr(run.entry, name) is None and name not in run.columns:
            message = f"neither {RUN_TABLE} (or the form) nor the rows of this file say it; write it into one of them"
            yield run.reject(Code.SCENARIO_MISSING, message, column=name)


def units(run: Candidate) -> Iterator[Finding]:
    """Time in milliseconds, lengths in millimetres or centimetres, pitch in degrees: off by the very factor.

    Time is compared with the declared horizon, height with the wheel radius (a wheel's centre is about one
    radius above the surface; half to twice that also holds for grousers and deep sinkage), the distance of
    the front wheel at the start with the wheelbase.
    """
    horizon, end = run.entry.horizon_s, float(run.time_s[-1])
    if horizon and 0.9 < end / horizon / 1000.0 < 1.1:
        message = f"ends at {end:g} where its horizon_s is {horizon:g}: looks like milliseconds, expected seconds"
        yield run.reject(Code.UNITS, message, at=len(run.time_s) - 1, column="time_s")
    radius = run.passport.rover.wheel_radius_m
    for unit, factor in _LENGTH_UNITS.items():
        height = float(np.median(run.columns["rear_y_m"]))
        if 0.5 < height / radius / factor < 2.0:
            message = f"median {height:g} with a wheel radius of {radius:g} m: looks like {unit}, expected metres"
            yield run.reject(Code.UNITS, message, column="rear_y_m")
    yield from _wheelbase_unit(run)


def _wheelbase_unit(run: Candidate) -> Iterator[Finding]:
    wheelbase = run.passport.rover.wheelbase_m
    if wheelbase is None or "front_x_m" not in run.columns:
        return
    # in the first row, where rear_x_m is zero: later a front in millimetres also moves a thousand times as far
    distance = float(run.columns["front_x_m"][0] - run.columns["rear_x_m"][0])
    for unit, factor in _LENGTH_UNITS.items():
        if 0.8 < distance / wheelbase / factor < 1.25:
            message = f"starts {distance:g} ahead of rear_x_m, wheelbase {wheelbase:g} m: looks like {unit}"
            yield run.reject(Code.UNITS, message, at=0, column="front_x_m")
            return
    if not 0.8 < distance / wheelbase < 1.25:
        message = f"starts {distance:g} m ahead of rear_x_m, the passport's wheelbase is {wheelbase:g} m"
        yield run.warn(Code.WHEELBASE, message, at=0, column="front_x_m")


def ranges(run: Candidate) -> Iterator[Finding]:
    """Every value is within its column's plausible range; the first that is not, per column."""
    for name, column in run.columns.items():
        limits = BY_NAME[name]
        bad = np.flatnonzero((column < limits.lowest) | (column > limits.highest))
        if len(bad) and name != "brake":
            message = (
                f"is {column[bad[0]]:g}, allowed is {limits.lowest:g}..{limits.highest:g} {limits.unit}: "
                f"{_OTHERWISE.get(name, 'another unit or another column?')}"
            )
            yield run.reject(Code.OUT_OF_RANGE, message, at=int(bad[0]), column=name)


def brake(run: Candidate) -> Iterator[Finding]:
    """A brake is on or off."""
    if "brake" not in run.columns:
        return
    column = run.columns["brake"]
    bad = np.flatnonzero((column != 0) & (column != 1))
    if len(bad):
        message = (
            f"is {column[bad[0]]:g} ({len(bad)} such rows), allowed is 1 (motors off, wheels locked) or 0: "
            "another column?"
        )
        yield run.reject(Code.OUT_OF_RANGE, message, at=int(bad[0]), column="brake")


def agreement(run: Candidate) -> Iterator[Finding]:
    """Slope and torque that the run's entry tells are those of the first row."""
    for name in ("slope_deg", "torque_nm"):
        declared = getattr(run.entry, name)
        if declared is None or name not in run.columns:
            continue
        first = float(run.columns[name][0])
        if abs(first - declared) * BY_NAME[name].scale > 1.0:
            message = (
                f"is {first:g} in the first row, but {declared:g} in {RUN_TABLE} or the form: give one of them, or "
                "rename this column if it is something else"
            )
            yield run.reject(Code.SCENARIO_VARIES, message, at=0, column=name)
