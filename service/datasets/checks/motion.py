"""Checks of the motion: origin, speed that physics allows, agreement of position and speed, wheel height."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from service.datasets.checks.candidate import Array, Candidate
from service.datasets.checks.recording import ahead_of_origin
from service.datasets.findings import Code, Finding
from service.datasets.passport import Passport

ORIGIN_TOLERANCE_M = 1e-6
"""The origin is the rear wheel at time 0, so x starts at 0; more than one micrometre is worth a word."""

ORIGIN_REJECT_M = 0.01
"""A centimetre is of the order of the errors that the learned model is judged by."""

NO_LOAD_MARGIN = 1.5
"""Room above the no-load rim speed for grousers (they enlarge the radius), ripple and the creep at release.

The largest wheel speed in the 80 VIPER runs is 0.814 m/s, 1.04 times the rim speed.
"""

SPEED_WINDOW_S = 0.05
SPEED_TOLERANCE_M_S = 0.05
SPEED_TOLERANCE_RELATIVE = 0.1
"""The largest RMS difference of chassis speed and wheel x-dot in the 80 VIPER runs is 0.018 m/s."""

WHEEL_BAND = (0.5, 1.3)
"""Height of a wheel's centre in wheel radii; the VIPER runs stay within 0.78..0.98."""


def origin(run: Candidate) -> Iterator[Finding]:
    """x starts at zero: the slope frame's origin is the rear wheel at time 0."""
    first = float(run.columns["rear_x_m"][0])
    if abs(first) <= ORIGIN_TOLERANCE_M:
        return
    # a file whose first row is one step late has moved a little: that is a warning at most
    say = run.reject if abs(first) > ORIGIN_REJECT_M else run.warn
    message = f"starts at {first:g} m, expected 0 (the rear wheel's start)"
    point = ahead_of_origin(run)
    if point is None:
        remedy = "pass --start first-row to count x and time from the first row, or --start SECONDS to count from there"
        yield say(Code.START_POSITION, f"{message}; {remedy}", at=0, column="rear_x_m")
    else:
        where, reference = point
        remedy = f"that is {where} ahead: if the positions are that point's, pass --reference {reference}"
        otherwise = "if they are the rear wheel's, --start first-row counts from its start"
        yield run.reject(Code.REFERENCE, f"{message}; {remedy}; {otherwise}", at=0, column="rear_x_m")


def fastest_m_s(passport: Passport, slope_deg: float | Array, time_s: Array) -> Array:
    """Speed that no wheel centre exceeds, (time,), m/s; `slope_deg` is a number or (time,).

    A motor drives only below its no-load speed omega_0, so traction brings a rover to R_w omega_0 at most
    (R_w: wheel radius). Beyond that only gravity accelerates it, by at most g |sin(slope)| for as long as it
    slides without any friction. Hence |v(t)| <= margin R_w omega_0 + g times the integral of |sin(slope)| from 0 to t,
    whatever torque and brake do. Where the passport has no no-load speed, 10 m/s stands for the first term: no rover
    on regolith is that fast.
    """
    drive = passport.drive
    if drive is None or drive.no_load_speed_rad_s is None:
        driven = 10.0
    else:
        driven = NO_LOAD_MARGIN * passport.rover.wheel_radius_m * drive.no_load_speed_rad_s
    steep = np.abs(np.sin(np.radians(np.broadcast_to(slope_deg, np.shape(time_s)))))
    # of two neighbours the steeper one: the slope may change anywhere between two rows
    steeper = np.maximum(steep, np.concatenate([steep[:1], steep[:-1]]))
    pulled: Array = np.cumsum(steeper * np.diff(time_s, prepend=0.0))
    return driven + passport.gravity_m_s2 * pulled


def jumps(run: Candidate) -> Iterator[Finding]:
    """No wheel moves faster than `fastest_m_s`, along the slope or normal to it; the worst step, per column.

    Files carry six significant digits (the default of C++ streams) or more, so that a difference of
    neighbours is known to 1e-5 of the largest position: that much is allowed on top.
    """
    steps = np.diff(run.time_s)
    limit = fastest_m_s(run.passport, run.acting("slope_deg"), run.time_s)[1:]
    for name in ("rear_x_m", "rear_y_m", "front_x_m", "front_y_m"):
        if name not in run.columns:
            continue
        position = run.columns[name]
        speed = np.abs(np.diff(position)) / steps
        excess = speed - limit - 1e-5 * np.abs(position).max() / steps
        count = int((excess > 0).sum())
        if count:
            worst = int(excess.argmax())
            message = (
                f"moves {position[worst + 1] - position[worst]:g} m in {steps[worst]:g} s, {speed[worst]:.3g} m/s; "
                f"at most {limit[worst]:.3g} m/s is possible here ({count} such rows)"
            )
            yield run.reject(Code.JUMP, message, at=worst + 1, column=name)


def speed(run: Candidate) -> Iterator[Finding]:
    """dx/dt agrees with the speed column: a column that is mislabelled (Chrono's VIPER slope demo writes angular
    velocity under ax..az) or mirrored does not. Both are averaged over windows of 0.05 s first, so that neither
    the digits of x nor the ripple of grousers counts.
    """
    if "speed_mps" not in run.columns:
        return
    time, x, v = run.time_s, run.columns["rear_x_m"], run.columns["speed_mps"]
    travelled = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2.0 * np.diff(time))])
    edges = np.unique(np.searchsorted(time, np.arange(time[0], time[-1], SPEED_WINDOW_S)))
    edges = np.append(edges, len(time) - 1) if edges[-1] != len(time) - 1 else edges
    width = np.diff(time[edges])
    from_x, from_speed = np.diff(x[edges]) / width, np.diff(travelled[edges]) / width
    difference = float(np.sqrt(np.mean((from_x - from_speed) ** 2)))
    allowed = SPEED_TOLERANCE_M_S + SPEED_TOLERANCE_RELATIVE * float(np.sqrt(np.mean(from_x**2)))
    if difference > allowed:
        worst = int(np.abs(from_x - from_speed).argmax())
        message = (
            f"differs from d rear_x_m/dt by {difference:.3g} m/s RMS, allowed is {allowed:.3g}: "
            "a mislabelled column or another sign?"
        )
        yield run.reject(Code.SPEED_MISMATCH, message, at=int(edges[worst]), column="speed_mps")


def wheel_band(run: Candidate) -> Iterator[Finding]:
    """The wheel's centre stays about one radius above the undeformed surface."""
    radius = run.passport.rover.wheel_radius_m
    lowest, highest = (factor * radius for factor in WHEEL_BAND)
    height = run.columns["rear_y_m"]
    outside = np.flatnonzero((height < lowest) | (height > highest))
    if len(outside):
        message = (
            f"is {height[outside[0]]:g} m, a wheel of radius {radius:g} m is expected within "
            f"{lowest:g}..{highest:g} m ({len(outside)} rows): surface not at zero, or deep sinkage?"
        )
        yield run.warn(Code.WHEEL_BAND, message, at=int(outside[0]), column="rear_y_m")
