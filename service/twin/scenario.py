"""What a user asks: one scenario in the units people state, and the times to answer at."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from service.errors import InvalidValueError
from service.physics.scenario import Array, Scenarios

SHORTEST_S = 1e-6  # a mean speed needs a time that can be divided by; nothing moves in a microsecond
_MOST_KEPT = 20_000  # steps of the grids that are kept, 160 kB each
_SAME_TIME = 1e-9  # of a step: a horizon this close to a multiple of dt_s is that multiple
_DECIMALS = 10  # a step that people write has no more; 600 s with that many are still exact in float64


@dataclass(frozen=True, slots=True)
class Scenario:
    """Slope (deg), mass (kg), motor stall torque per wheel (N m) and horizon (s).

    Raises InvalidValueError for values that are not finite or not physical. Narrower limits are the caller's.
    """

    slope_deg: float
    mass_kg: float
    torque_nm: float
    horizon_s: float

    def __post_init__(self) -> None:
        fits = -90.0 < self.slope_deg < 90.0 and 0.0 < self.mass_kg < math.inf and 0.0 <= self.torque_nm < math.inf
        if not (fits and SHORTEST_S < self.horizon_s < math.inf):
            self._refuse()

    def _refuse(self) -> None:
        """Raises InvalidValueError for the first value that does not fit."""
        for field, lowest, highest, allowed in (
            ("slope_deg", -90.0, 90.0, "more than -90 and less than 90"),
            ("mass_kg", 0.0, math.inf, "positive and finite"),
            ("torque_nm", -math.ulp(0.0), math.inf, "zero or positive, and finite"),
            ("horizon_s", SHORTEST_S, math.inf, f"more than {SHORTEST_S:g} and finite"),
        ):
            if not lowest < getattr(self, field) < highest:
                raise InvalidValueError(field, getattr(self, field), allowed)

    def as_physics(self) -> Scenarios:
        """The same in SI units and radians, as a batch of one."""
        return Scenarios.of(self.slope_deg, self.mass_kg, self.torque_nm)


@lru_cache(maxsize=1024)
def sample_count(horizon_s: float, dt_s: float) -> int:
    """How many times `sample_times` returns."""
    return math.floor(horizon_s / dt_s + _SAME_TIME) + 1 + (not _ends_on_step(horizon_s, dt_s))


def sample_times(horizon_s: float, dt_s: float) -> Array:
    """0, dt, 2 dt, ... and always the horizon itself as the last time; shape (time,), s.

    Multiples of a decimal step are the decimals themselves: 0.15, not the 0.15000000000000002 that 3 x 0.05 gives.
    The array is read-only: who asks for the same times again may get the same one.

    Raises InvalidValueError unless both are positive and finite.
    """
    for field, value in (("horizon_s", horizon_s), ("dt_s", dt_s)):
        if not 0 < value < math.inf:
            raise InvalidValueError(field, value, "positive and finite")
    return _kept_times(horizon_s, dt_s) if horizon_s <= _MOST_KEPT * dt_s else _times(horizon_s, dt_s)


def _times(horizon_s: float, dt_s: float) -> Array:
    steps = math.floor(horizon_s / dt_s + _SAME_TIME)
    times = np.arange(steps + 1, dtype=np.float64) * dt_s
    if round(dt_s, _DECIMALS) == dt_s:
        np.round(times, _DECIMALS, out=times)
    if _ends_on_step(horizon_s, dt_s):
        times[-1] = horizon_s
    else:
        times = np.append(times, horizon_s)
    times.flags.writeable = False
    return times


_kept_times = lru_cache(maxsize=16)(_times)


def _ends_on_step(horizon_s: float, dt_s: float) -> bool:
    ratio = horizon_s / dt_s
    return round(ratio) >= 1 and abs(ratio - round(ratio)) <= _SAME_TIME
