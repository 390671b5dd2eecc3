"""What can be said of a rover at one moment, from its speed and those of its wheels: the same for drives and steps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array

MOVES_M_S = 0.001
_STANDS_M_S = 1e-9  # of rover and rims together: nothing slips


def slip_ratios(wheel_radius_m: float, speed_m_s: Array, rear_rad_s: Array, front_rad_s: Array) -> Array:
    """(R w - v) / max(|R w|, |v|), of any one shape, with w the mean of both axles.

    0 rolls, 1 spins on the spot; up to 2 where wheels turn forwards and the rover goes back, below 0 where it outruns
    its wheels: -1 with wheels that are locked. 1 - v / (R w) for a rover that drives. Finite for finite speeds.
    """
    rims = (0.5 * wheel_radius_m) * (rear_rad_s + front_rad_s)
    larger = np.maximum(np.abs(rims), np.abs(speed_m_s))
    if larger.min(initial=np.inf) >= _STANDS_M_S:
        return np.asarray((rims - speed_m_s) / larger)
    stands = larger < _STANDS_M_S
    return np.asarray(np.where(stands, 0.0, rims - speed_m_s) / np.where(stands, 1.0, larger))


def slip_ratio(wheel_radius_m: float, speed_m_s: float, rear_rad_s: float, front_rad_s: float) -> float:
    """The same, to the bit, of plain numbers: for one rover ten times faster."""
    rims = (0.5 * wheel_radius_m) * (rear_rad_s + front_rad_s)
    larger = max(abs(rims), abs(speed_m_s))
    return 0.0 if larger < _STANDS_M_S else (rims - speed_m_s) / larger


def moves(speed_m_s: Array) -> npt.NDArray[np.bool_]:
    """Whether it moves, at 1 mm/s and more in either direction; of the shape of the speeds."""
    return np.asarray(np.abs(speed_m_s) >= MOVES_M_S)
