"""Checks of what may come beside the positions: spin of the wheels and pitch agree with how the rover moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from service.datasets.checks.candidate import Array, Candidate
from service.datasets.findings import Code, Finding

SPINS = ("rear_omega_radps", "front_omega_radps")
MOST_SPIN = 2.0
"""Times the motor's no-load speed, or the spin of a wheel that rolls as fast as the rover goes: in the 167 shipped runs
at most 1.0. Turns per minute are 9.5 times as large, degrees per second 57 times."""

LEAST_WAY_M = 0.3
LEAST_TURNED = 0.5
"""Way of the rim over way of the rover, where a rover goes forward by its wheels: in the shipped runs at least 0.82."""

LEAST_PITCH_RAD = 0.005
PITCH_FACTOR = 3.0
"""Pitch over the angle between the wheels, RMS: in the shipped runs 0.985 to 1.002. Its sign is not looked at: theirs
is nose down, while `columns` says nose up."""


def spin(run: Candidate) -> Iterator[Finding]:
    """Wheels turn at most about as fast as the motor without load, or as the ground carries them, and forward where the
    rover goes forward by them.
    """
    radius_m = run.passport.rover.wheel_radius_m
    no_load = run.passport.drive.no_load_speed_rad_s if run.passport.drive else None
    if len(run.time_s) < 2:
        return
    x = run.columns["rear_x_m"]
    rolling = float(np.abs(np.diff(x) / np.diff(run.time_s)).max()) / radius_m
    way_m = float(x[-1] - x[0])
    for name in SPINS:
        if name not in run.columns:
            continue
        omega = run.columns[name]
        worst = int(np.abs(omega).argmax())
        if no_load is not None and abs(omega[worst]) > MOST_SPIN * max(no_load, rolling):
            message = (
                f"is {omega[worst]:.4g} rad/s, at most {max(no_load, rolling):.4g} is expected (no-load speed, or "
                "rolling along): turns per minute, or degrees per second?"
            )
            yield run.reject(Code.UNITS, message, at=worst, column=name)
        elif way_m > LEAST_WAY_M and "brake" not in run.columns:
            rim_m = radius_m * _over_time(omega, run.time_s)
            if rim_m < LEAST_TURNED * way_m:
                message = (
                    f"the rim goes {rim_m:.3g} m while the rover goes {way_m:.3g} m: another sign (positive is "
                    "uphill), another unit, or another wheel?"
                )
                yield run.reject(Code.SPEED_MISMATCH, message, column=name)


def pitch(run: Candidate) -> Iterator[Finding]:
    """Pitch is as large as the angle at which the front wheel stands above the rear one."""
    names = ("pitch_rad", "front_x_m", "front_y_m")
    if any(name not in run.columns for name in names):
        return
    ahead = run.columns["front_x_m"] - run.columns["rear_x_m"]
    above = run.columns["front_y_m"] - run.columns["rear_y_m"]
    told, seen = (float(np.sqrt(np.mean(each**2))) for each in (run.columns["pitch_rad"], np.arctan2(above, ahead)))
    if max(told, seen) > LEAST_PITCH_RAD and not 1 / PITCH_FACTOR < told / max(seen, 1e-9) < PITCH_FACTOR:
        message = (
            f"is {told:.3g} rad RMS, the wheels stand at {seen:.3g} rad to each other: degrees, the pitch to the "
            "horizontal, or front and rear exchanged?"
        )
        yield run.reject(Code.UNITS, message, column="pitch_rad")


def _over_time(values: Array, time_s: Array) -> float:
    return float(np.sum((values[1:] + values[:-1]) / 2.0 * np.diff(time_s)))
