"""What the whole way of each of many scenarios comes to, told by 400 even parts of its horizon."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.learning.drive.library import CompiledWholes, address
from service.physics.scenario import Array

_ROWS = 7  # ROVER_WHOLE of native/engine.h
MOST_LOOKS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Whole:
    """Columns (scenario,), m and rad/s: x where the last quarter begins and at the end, y there, the path's length, the
    mean speed of all wheels; and x at each look, (scenario, look).
    """

    late_x_m: Array
    end_x_m: Array
    end_y_m: Array
    path_m: Array
    wheels_rad_s: Array
    seen_m: Array


class WholesAsked:
    """Where the engine writes them; kept by the caller until it has."""

    def __init__(self, horizon_s: Array, look_s: Array) -> None:
        """Horizons (scenario,) contiguous; at most MOST_LOOKS looks, or ValueError."""
        if len(look_s) > MOST_LOOKS:
            raise ValueError(f"at most {MOST_LOOKS} looks, got {len(look_s)}")
        self._horizon_s, self._looks = horizon_s, len(look_s)
        self._numbers = np.zeros((_ROWS, len(horizon_s)))
        looks = (*look_s.tolist(), 0.0, 0.0)[:MOST_LOOKS]
        self.compiled = CompiledWholes(address(horizon_s), self._looks, looks, address(self._numbers))

    def found(self) -> Whole:
        """What the engine wrote."""
        late, end, height, path, wheels = self._numbers[:5]
        return Whole(late, end, height, path, wheels, self._numbers[5 : 5 + self._looks].T)
