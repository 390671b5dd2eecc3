"""The ground under a drive: slope over distance along the surface, made from slopes or from elevations.

Between knots the slope changes linearly with the distance, beyond them it stays. So the surface is known exactly: over
a piece of length h whose slope goes from a to b, the chord has the slope (a + b) / 2 and the length h sin(d) / d with
d = (b - a) / 2. The world frame follows it: x is horizontal, z up, both zero where the rear wheel starts;
a point y above the surface lies along the normal there.

Elevations are a polyline over the horizontal. Its slope would jump at the knots, which no wheelbase does: each segment
has its slope at its middle, and between two middles it changes linearly. The surface is then that of the polyline but
for rounded corners. Horizontal 0 is where the rear wheel starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from service.errors import InvalidValueError
from service.learning.drive.inputs import Track
from service.physics.scenario import Array

STEEPEST_DEG = 90.0
_ROUNDING_DEG = 1e-6  # of elevations, whose slopes are no decimals
_RADIANS = np.pi / 180.0


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Knots: distance (m) along the surface from where the rear wheel starts, rising, and slope (deg, positive uphill).

    Raises InvalidValueError for no knots, columns of unequal lengths, distances that do not rise, slopes that are
    vertical or steeper, and numbers that are not finite. `end_m` is where the track as it was given ends; None for one
    of a single knot, which goes on for ever.
    """

    distance_m: Array
    slope_deg: Array
    end_m: float | None = None
    track: Track = field(init=False, repr=False)

    def __post_init__(self) -> None:
        try:
            track = Track(self.distance_m, self.slope_deg * _RADIANS)
        except ValueError:
            self._refuse()
            raise
        object.__setattr__(self, "track", track)

    def _refuse(self) -> None:
        """Says what is wrong with knots that make no track, by the name of the field."""
        if len(self.slope_deg) != len(self.distance_m):
            allowed = f"one for each of {len(self.distance_m)} distances"
            raise InvalidValueError("track.slope_deg", f"{len(self.slope_deg)} slopes", allowed)
        require_rising("track.distance_m", self.distance_m)
        steep = ~(np.abs(self.slope_deg) < STEEPEST_DEG)
        if steep.any():
            allowed = f"more than -{STEEPEST_DEG:g} and less than {STEEPEST_DEG:g}"
            raise InvalidValueError("track.slope_deg", float(self.slope_deg[int(steep.argmax())]), allowed)

    @classmethod
    def of_slopes(cls, distance_m: Sequence[float] | Array, slope_deg: Sequence[float] | Array) -> Ground:
        """From slopes at distances along the surface."""
        knots = np.asarray(distance_m, dtype=np.float64)
        return cls(knots, np.asarray(slope_deg, dtype=np.float64), float(knots[-1]) if knots.shape > (1,) else None)

    @classmethod
    def constant(cls, slope_deg: float) -> Ground:
        """The same slope everywhere."""
        return cls(np.zeros(1), np.array([slope_deg], dtype=np.float64))

    @classmethod
    def of_elevations(
        cls,
        horizontal_m: Sequence[float] | Array,
        elevation_m: Sequence[float] | Array,
        steepest_deg: float = STEEPEST_DEG,
    ) -> Ground:
        """From elevations over the horizontal, two at least. Raises InvalidValueError for steeper slopes."""
        across, up = np.asarray(horizontal_m, dtype=np.float64), np.asarray(elevation_m, dtype=np.float64)
        if len(up) != len(across):
            allowed = f"one for each of {len(across)} places"
            raise InvalidValueError("track.elevation_m", f"{len(up)} elevations", allowed)
        if len(across) < 2:
            raise InvalidValueError("track.horizontal_m", f"{len(across)} places", "two or more: one has no slope")
        require_rising("track.horizontal_m", across)
        if not np.isfinite(up).all():
            raise InvalidValueError("track.elevation_m", float(up[~np.isfinite(up)][0]), "finite numbers")
        run, rise = np.diff(across), np.diff(up)
        slopes = np.degrees(np.arctan2(rise, run))
        steeper = np.abs(slopes) > steepest_deg + _ROUNDING_DEG
        if steeper.any():
            at = int(steeper.argmax())
            said = f"{slopes[at]:.6g} deg from horizontal_m {across[at]:.12g} to {across[at + 1]:.12g}"
            raise InvalidValueError("track.elevation_m", said, f"slopes from {-steepest_deg:g} to {steepest_deg:g} deg")
        slopes = np.clip(slopes, -steepest_deg, steepest_deg)
        lengths = np.hypot(run, rise)
        knots = np.concatenate([[0.0], np.cumsum(lengths)])
        segment = int(np.clip(np.searchsorted(across, 0.0, side="right") - 1, 0, len(run) - 1))
        start = knots[segment] - across[segment] * lengths[segment] / run[segment]
        middles = 0.5 * (knots[1:] + knots[:-1]) - start
        if not (np.diff(middles) > 0).all():
            raise InvalidValueError("track.horizontal_m", "places too near each other", "places that can be told apart")
        return cls(middles, slopes, float(knots[-1] - start))

    def slopes_at(self, distance_m: Array) -> Array:
        """Slopes (deg) at distances (m), of one shape."""
        if len(self.slope_deg) == 1:
            return np.full(np.shape(distance_m), self.slope_deg[0])
        return np.asarray(np.interp(distance_m, self.distance_m, self.slope_deg))

    def steepest(self, low_m: float, high_m: float) -> tuple[float, float]:
        """The slope (deg) of largest size between two distances, and the first distance (m) that has it."""
        if len(self.slope_deg) == 1:
            return float(self.slope_deg[0]), low_m
        first, last = np.searchsorted(self.distance_m, (low_m, high_m))
        places = np.concatenate([[low_m], self.distance_m[first:last], [high_m]])
        slopes = self.slopes_at(places)
        at = int(np.abs(slopes).argmax())
        return float(slopes[at]), float(places[at])

    def extremes_deg(self) -> tuple[float, float]:
        """Lowest and highest slope anywhere."""
        return float(self.slope_deg.min()), float(self.slope_deg.max())

    def world(self, x_m: Array, y_m: Array) -> tuple[Array, Array]:
        """Horizontal and up (m) of points y above the surface at distances x, (time,)."""
        across, up = _surface(self.distance_m, self.track.slope_rad, np.append(x_m, 0.0))
        angle = np.radians(self.slopes_at(x_m))
        return across[:-1] - across[-1] - y_m * np.sin(angle), up[:-1] - up[-1] + y_m * np.cos(angle)


def _surface(knots_m: Array, slope_rad: Array, distance_m: Array) -> tuple[Array, Array]:
    """Horizontal and up (m) of the surface at distances, from its first knot; negative before it."""
    pieces = _chord(np.diff(knots_m), slope_rad[:-1], slope_rad[1:])
    across, up = (np.concatenate([[0.0], np.cumsum(each)]) for each in pieces)
    rows = np.maximum(np.searchsorted(knots_m, distance_m, side="right") - 1, 0)
    there = np.interp(distance_m, knots_m, slope_rad)
    part = _chord(distance_m - knots_m[rows], slope_rad[rows], there)
    return across[rows] + part[0], up[rows] + part[1]


def _chord(length_m: Array, from_rad: Array, to_rad: Array) -> tuple[Array, Array]:
    """Horizontal and up between the ends of pieces whose slope changes linearly."""
    middle = 0.5 * (from_rad + to_rad)
    chord = length_m * np.sinc((to_rad - from_rad) / (2.0 * np.pi))
    return chord * np.cos(middle), chord * np.sin(middle)


def require_rising(field: str, values: Array) -> None:
    """Raises InvalidValueError for no values, and for such as are not finite or do not rise, naming two neighbours."""
    if values.ndim != 1 or not len(values):
        raise InvalidValueError(field, f"{len(values)} values", "one value or more")
    if not np.isfinite(values).all():
        raise InvalidValueError(field, float(values[~np.isfinite(values)][0]), "finite numbers")
    steps = values[1:] > values[:-1]
    if not steps.all():
        at = int(steps.argmin())
        raise InvalidValueError(field, f"{values[at]:.12g}, {values[at + 1]:.12g}", "values that rise")
