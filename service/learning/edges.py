"""The two edges of a band."""

from __future__ import annotations

from dataclasses import dataclass

from service.physics.scenario import Array


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Between which x and y (m) lie, as often as the level says: arrays of shape (scenario, time)."""

    x_low_m: Array
    x_high_m: Array
    y_low_m: Array
    y_high_m: Array
