"""Whether the columns of a demo hold what their names say: positions against velocities, velocities against
accelerations. A name is a claim; the numbers beside it can bear it out or not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from service.datasets.checks.candidate import Array
from service.datasets.checks.motion import SPEED_TOLERANCE_M_S, SPEED_TOLERANCE_RELATIVE
from service.datasets.checks.motion import SPEED_WINDOW_S as WINDOW_S
from service.datasets.findings import Code, Finding, reject, warn
from service.datasets.readers.presets import DEMOS, Demo, Rate

QUARTERS = 4
"""Accelerations are compared over quarters of a run: they ripple faster than a file's rows follow, but not for long."""

BETTER = 4.0
"""Another column must fit so many times better than the one with the right name to be taken for it."""

FITS = 0.3
"""How much of a position's motion a velocity may leave unexplained and still be taken for the right one."""

AGREES, DIFFERS, ALIKE = 0.2, 0.35, 0.2
"""Mean difference of dv/dt and acceleration, as a part of the size of the latter, and how much both correlate.

Of 51 shipped runs, a row each 10 ms, accelerations (second differences of the position) have at most 0.08 and at least
0.30; the wheel's angular velocity in their place has at least 0.45.
"""

NOTHING = 1e-6
"""Accelerations below this, m/s2, are zeros: a column that somebody left empty."""

LONGEST_S = 1000.0
ABSURD = 1e9
"""No run is that long, and no position, speed or acceleration that large."""

DIGITS = 1e-5
"""Six significant digits are known to this part of the largest value."""


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """Mean rates of change over windows of time, (window,): of a column, and as another one says."""

    seen: Array
    said: Array

    @property
    def error(self) -> float:
        """RMS difference."""
        return _rms(self.seen - self.said)


def mean_rates(time_s: Array, column: Array, rate: Array, window_s: float) -> Means:
    """How `column` changes, and how `rate` says that it does, in windows of about `window_s`; all are (time,)."""
    grown = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * np.diff(time_s))])
    edges = np.unique(np.searchsorted(time_s, np.arange(time_s[0], time_s[-1], window_s)))
    edges = np.append(edges, len(time_s) - 1) if edges[-1] != len(time_s) - 1 else edges
    width = np.diff(time_s[edges])
    return Means(np.diff(column[edges]) / width, np.diff(grown[edges]) / width)


def can_be_compared(time_s: Array) -> bool:
    """Whether times (row,), s, are those of a run, so that differences mean something and windows are not too many."""
    if len(time_s) < 3 or not np.isfinite(time_s).all():
        return False
    return bool((np.diff(time_s) > 0).all()) and float(time_s[-1] - time_s[0]) <= LONGEST_S


def check_labels(preset: str | None, time_s: Array, columns: Mapping[str | int, Array], *, file: str) -> list[Finding]:
    """What the columns of one run say about each other, if a demo wrote it; `columns` are by the demo's own names.

    Nothing, where time does not increase or a number is missing or absurd: other checks tell that.
    """
    if preset is None or not can_be_compared(time_s):
        return []
    demo = DEMOS[preset]
    known = {name: column for name, column in columns.items() if np.isfinite(column).all() and _is_sane(column)}
    rates = [pair for pair in demo.rates if set(pair) <= set(known)]
    return [*_positions(rates, time_s, known, file), *_accelerations(demo, time_s, known, file)]


def _positions(
    rates: Sequence[Rate], time_s: Array, columns: Mapping[str | int, Array], file: str
) -> Iterator[Finding]:
    """A rejection for each position that changes as the velocity of another one says; a word where no velocity fits."""
    window = max(WINDOW_S, 5.0 * float(np.median(np.diff(time_s))))
    for position, velocity in rates:
        every = {each: mean_rates(time_s, columns[position], columns[each], window) for _, each in rates}
        best = min(every, key=lambda each: every[each].error)
        own, other = every[velocity].error, every[best].error
        noise = DIGITS * float(np.abs(columns[position]).max()) / window + 1e-4
        moves = _rms(every[velocity].seen)
        if best != velocity and own > BETTER * max(other, noise) and other <= max(FITS * moves, noise):
            message = (
                f"changes as {best!r} says, not as {velocity!r}: the names of two columns are exchanged "
                f"(differences {other:.2g} and {own:.2g} m/s RMS)"
            )
            yield reject(file, Code.MISLABELLED, message, column=str(position))
        elif own > SPEED_TOLERANCE_M_S + SPEED_TOLERANCE_RELATIVE * moves:
            message = f"is not how {position!r} changes: they differ by {own:.2g} m/s RMS"
            yield warn(file, Code.MISLABELLED, message, column=str(velocity))


def _accelerations(demo: Demo, time_s: Array, columns: Mapping[str | int, Array], file: str) -> Iterator[Finding]:
    """Whether the columns called accelerations are those; they are not used in either case."""
    claims = [pair for pair in demo.accelerations if set(pair) <= set(columns)]
    if not claims:
        return
    window = float(time_s[-1] - time_s[0]) / QUARTERS
    means = [mean_rates(time_s, columns[velocity], columns[claim], window) for velocity, claim in claims]
    error = _rms(np.concatenate([each.seen - each.said for each in means]))
    said = np.concatenate([columns[claim] for _, claim in claims])
    seen = np.concatenate([np.gradient(columns[velocity], time_s) for velocity, _ in claims])
    size, alike = _rms(said), float(np.mean(seen * said)) / max(_rms(seen) * _rms(said), 1e-30)
    largest = max((claim for _, claim in claims), key=lambda claim: float(np.abs(columns[claim]).mean()))
    differ = f"over {window:.3g} s dv/dt differs from them by {error:.2g} RMS, they are {size:.2g} RMS"
    message = ""
    if size < NOTHING:
        return
    if error > DIFFERS * size:
        message = f"hold no accelerations: {differ}, the mean of {largest} is {float(columns[largest].mean()):.3g}"
        message += f"; this demo writes {demo.instead}" if demo.instead else ""
    elif error > AGREES * size or alike < ALIKE:
        message = f"may hold accelerations or something else: {differ}, their correlation is {alike:.2f}"
    elif demo.instead:
        message = f"do hold accelerations: {differ}; the demo as published writes {demo.instead}"
    if message:
        names = ", ".join(str(claim) for _, claim in claims)
        yield warn(file, Code.MISLABELLED, f"{message}; they are not used", column=names)


def _is_sane(column: Array) -> bool:
    return bool((np.abs(column) < ABSURD).all())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
