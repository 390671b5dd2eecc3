"""Checks of the time axis: increasing, from zero to the declared horizon, without holes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from service.datasets.alignment import stamp
from service.datasets.checks.candidate import Candidate
from service.datasets.checks.recording import moves_at_start, settled_until
from service.datasets.columns import BY_NAME
from service.datasets.findings import MAX_LOCATED, Code, Finding

MIN_ROWS = 10
"""Fewer rows cannot show a start, a climb and an end."""

MOST_STEPS = 10
"""Chrono programs write every step or every few of them; more apart is another column or unit."""

GAP_FACTOR = 5.0
"""A step longer than this many median steps is a hole; solvers with variable step vary less between neighbours."""

VARIES = 0.5
"""Steps that differ by more than this part of the shorter one; a row that waits for a step to end differs by less."""

GAP_REJECT_S = 0.25
"""A rover at VIPER's 0.8 m/s moves 20 cm in a hole this long: the learned curve would be a guess."""


def rows(run: Candidate) -> Iterator[Finding]:
    """Enough rows to be a trajectory."""
    if len(run.time_s) < MIN_ROWS:
        yield run.reject(Code.TOO_FEW_ROWS, f"{len(run.time_s)} rows, at least {MIN_ROWS} are needed")


def increasing(run: Candidate) -> Iterator[Finding]:
    """Times increase at the stored resolution of a microsecond."""
    steps = np.diff(np.rint(run.time_s * BY_NAME["time_s"].scale))
    yield from _disorder(run, np.flatnonzero(steps == 0), Code.TIME_DUPLICATE, "repeats the time of the row before")
    yield from _disorder(run, np.flatnonzero(steps < 0), Code.TIME_BACKWARD, "is earlier than the row before")


def _disorder(run: Candidate, before: npt.NDArray[np.intp], code: Code, what: str) -> Iterator[Finding]:
    for index in before[:MAX_LOCATED].tolist():
        now, earlier = run.time_s[index + 1], run.time_s[index]
        message = f"{now:.9g} {what} ({earlier:.9g}); {len(before)} such rows"
        if code is Code.TIME_DUPLICATE:
            message += "; write times with more digits, or each row once"
        yield run.reject(code, message, at=index + 1, column="time_s")


def start(run: Candidate) -> Iterator[Finding]:
    """Time starts at zero, or one step later: Chrono programs may write after the first step."""
    first, step = float(run.time_s[0]), float(np.median(np.diff(run.time_s)))
    if first > 1.5 * step:
        shown = "0" if not run.shift_s else f"{stamp(run.shift_s)} s, as was said,"
        message = (
            f"starts at {stamp(first + run.shift_s)} s, expected {shown} (the moment when wheels are released and "
            f"motors switched on); {_start_remedy(run)}"
        )
        yield run.reject(Code.START_TIME, message, at=0, column="time_s")


def _start_remedy(run: Candidate) -> str:
    if settled_until(run) is None and moves_at_start(run) is None:
        return (
            "if that was in the first row, where the rover still rests, pass --start first-row (time and x are counted "
            "from there); else its time, --start SECONDS"
        )
    return "pass the time of that moment, --start SECONDS"


def horizon(run: Candidate) -> Iterator[Finding]:
    """The last time is the horizon of runs.csv: within two steps or 0.1 %."""
    declared, end = run.entry.horizon_s, float(run.time_s[-1])
    if declared is None:
        return
    tolerance = max(2.0 * float(np.median(np.diff(run.time_s))), 1e-3 * declared)
    if end < declared - tolerance:
        message = f"ends at {end:g} s, its horizon_s is {declared:g}: the simulation stopped early?"
        yield run.reject(Code.HORIZON, message, at=len(run.time_s) - 1, column="time_s")
    elif end > declared + tolerance:
        message = f"goes on to {end:g} s, its horizon_s is {declared:g}"
        yield run.warn(Code.HORIZON, message, at=len(run.time_s) - 1, column="time_s")


def step(run: Candidate) -> Iterator[Finding]:
    """The median step is the `step_s` of runs.csv, where it is given, or up to ten of it: every n-th row is kept."""
    declared, median = run.entry.step_s, float(np.median(np.diff(run.time_s)))
    if declared is not None and not _is_multiple(median, declared):
        message = (
            f"median step is {median:g} s, runs.csv says step_s {declared:g}, allowed are 1 to {MOST_STEPS} of that"
        )
        yield run.warn(Code.STEP, message, column="time_s")


def varying(run: Candidate) -> Iterator[Finding]:
    """Solvers with a variable step are welcome; what their steps are is worth a word. Single long steps are `gaps`."""
    steps = np.diff(run.time_s)
    shortest, longest = np.percentile(steps, [5.0, 95.0])
    # times of six digits are known to this
    digits = 2e-5 * float(run.time_s[-1])
    if longest - shortest > VARIES * shortest + digits:
        median = float(np.median(steps))
        message = f"the time step varies from {steps.min():.3g} to {steps.max():.3g} s, its median is {median:.3g} s"
        yield run.warn(Code.STEP, message, column="time_s")


def _is_multiple(step_s: float, of_s: float) -> bool:
    times = round(step_s / of_s) if of_s > 0 else 0
    return 1 <= times <= MOST_STEPS and abs(step_s - times * of_s) <= 0.01 * times * of_s


def gaps(run: Candidate) -> Iterator[Finding]:
    """No step is much longer than the median step."""
    steps = np.diff(run.time_s)
    median = float(np.median(steps))
    found = np.flatnonzero(steps > GAP_FACTOR * median)
    for index in found[:MAX_LOCATED].tolist():
        message = f"{steps[index]:g} s without a row, the median step is {median:g} s; {len(found)} such gaps"
        say = run.reject if steps[index] > GAP_REJECT_S else run.warn
        yield say(Code.SAMPLING_GAP, message, at=index + 1, column="time_s")
