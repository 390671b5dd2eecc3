"""Slope frame and world frame.

Slope frame: x along the slope, positive uphill; y normal to it, from the undeformed surface.
World frame: the slope frame rotated by the slope angle about the same origin; x horizontal, z up.
"""

from __future__ import annotations

import numpy as np

from service.physics.scenario import Array


def slope_to_world(x_m: Array, y_m: Array, slope_angle_rad: float | Array) -> tuple[Array, Array]:
    """Horizontal and vertical position (m) of points given along and normal to the slope; shapes broadcast."""
    cosine, sine = np.cos(slope_angle_rad), np.sin(slope_angle_rad)
    return x_m * cosine - y_m * sine, x_m * sine + y_m * cosine


def world_to_slope(x_m: Array, z_m: Array, slope_angle_rad: float | Array) -> tuple[Array, Array]:
    """Inverse of `slope_to_world`: position (m) along and normal to the slope; shapes broadcast."""
    cosine, sine = np.cos(slope_angle_rad), np.sin(slope_angle_rad)
    return x_m * cosine + z_m * sine, z_m * cosine - x_m * sine
