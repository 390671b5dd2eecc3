"""How many points an answer may have: of one trajectory, and of many in one request."""

from __future__ import annotations

import math
from collections.abc import Sequence

from service.errors import InvalidValueError
from service.physics.scenario import Array
from service.settings import LIMITS
from service.twin import sample_grid
from service.twin.scenario import sample_count

BATCH_FACTOR = 10
"""A batch may have that many times the points of one trajectory."""


def most_points(scenarios: int, max_points: int) -> int:
    """How many points each of so many trajectories may have, where one alone may have `max_points`."""
    return max(2, min(max_points, BATCH_FACTOR * max_points // max(scenarios, 1)))


def _limit(scenarios: int, max_points: int, what: str) -> str:
    most = most_points(scenarios, max_points)
    return f"at most {most} {what}" + (f" for each of {scenarios}" if scenarios > 1 else "")


def require_few_times(times: int, scenarios: int, max_points: int) -> None:
    """Raises InvalidValueError for more times than `most_points`."""
    if times > most_points(scenarios, max_points):
        raise InvalidValueError("times_s", f"{times} times", _limit(scenarios, max_points, "times"))


def require_wide_step(horizon_s: float, dt_s: float, scenarios: int, max_points: int) -> None:
    """Raises InvalidValueError, with the steps that this horizon allows, for one that gives too many points."""
    most = most_points(scenarios, max_points)
    if sample_count(horizon_s, dt_s) > most:
        steps = f"{smallest_step_s(horizon_s, most):g} to {LIMITS.dt_s[1]:g}"
        allowed = f"{steps} for a horizon_s of {horizon_s:g} ({_limit(scenarios, max_points, 'points')})"
        raise InvalidValueError("dt_s", dt_s, allowed)


def bounded_grid(horizons_s: Sequence[float], dt_s: float, max_points: int) -> Array:
    """The times of `sample_grid`. Raises InvalidValueError for too many, as if each horizon were the longest."""
    require_wide_step(max(horizons_s), dt_s, len(horizons_s), max_points)
    return sample_grid(horizons_s, dt_s)


def smallest_step_s(horizon_s: float, most: int) -> float:
    """The smallest step that keeps to `most` points, rounded up to three significant digits so that it can be typed."""
    exact = max(horizon_s / (most - 1), LIMITS.dt_s[0])
    unit = 10.0 ** (math.floor(math.log10(exact)) - 2)
    return float(f"{math.ceil(exact / unit * (1 - 1e-12)) * unit:.3g}")
