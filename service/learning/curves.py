"""Straight lines between the points of many curves at once, as `numpy.interp` draws them for one."""

from __future__ import annotations

import numpy as np

from service.physics.scenario import Array


def interpolate_curves(asked: Array, grid: Array, curves: Array) -> Array:
    """Curves (curve, grid point) over one rising grid, read at `asked` of shape (point,) or (curve, point).

    Past the ends of the grid a curve is held. The answer has shape (curve, point).
    """
    if asked.ndim == 2:
        return interpolate_each(asked, grid, curves)
    if len(grid) == 1:
        return np.repeat(curves, len(asked), axis=1)
    cell = np.clip(np.searchsorted(grid, asked, side="right") - 1, 0, len(grid) - 2)
    low = curves[:, cell]
    rise = (curves[:, cell + 1] - low) / (grid[cell + 1] - grid[cell])
    found = rise * (np.maximum(asked, grid[0]) - grid[cell]) + low
    # as numpy.interp has it: the last point itself, not what the last cell's line rounds to there
    found[:, asked >= grid[-1]] = curves[:, -1:]
    return np.asarray(found, dtype=np.float64)


def interpolate_each(asked: Array, grids: Array, curves: Array) -> Array:
    """Curves (curve, grid point), read at (point,) or (curve, point); `grids` is of one's or of all curves' shape.

    Row by row, since within a row numpy.interp goes along the points faster than arrays over all rows could.
    """
    found = np.empty((len(curves), asked.shape[-1]))
    for row, curve in enumerate(curves):
        found[row] = np.interp(
            asked if asked.ndim == 1 else asked[row], grids if grids.ndim == 1 else grids[row], curve
        )
    return found
