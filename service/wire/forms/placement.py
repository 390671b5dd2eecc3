"""Where on a stage a rover is put, and how that stage counts: the numbers of `translate`, `orient` and `scale`.

The twin's world is Z-up, in metres, with X horizontal and ahead. A Y-up stage sees its (x, y, z) as (x, z, -y).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from service.physics.scenario import Array

Axes = tuple[float | Array, float | Array, float | Array]
_PLAIN = ("xformOp:translate", "xformOp:orient", "xformOp:scale")
_PIVOTED = (
    "xformOp:translate",
    "xformOp:translate:pivot",
    "xformOp:orient",
    "xformOp:scale",
    "!invert!xformOp:translate:pivot",
)


@dataclass(frozen=True, slots=True)
class Placement:
    """`prim_path` is the moved prim, empty for one of our own.

    `origin_m` (x, y, z along the axes of the stage) is where the answer has its zero, `heading_deg` where the rover
    looks, from X counterclockwise as seen from above. `pivot` is the point of the asset, in its own coordinates, that
    is put there: the middle between the rear wheels' centres. `scale` replaces the asset's. `proxy` adds a rover made
    of simple shapes. In a fleet each rover starts `spacing_m` to the right of the one before.
    """

    prim_path: str = ""
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    pivot: tuple[float, float, float] | None = None
    scale: float | None = None
    up_axis: str = "Z"
    meters_per_unit: float = 1.0
    proxy: bool = False
    spacing_m: float = 0.0

    def question(self) -> bytes:
        """What decides how the layer looks, for entity tags; empty for a plain one."""
        return b"" if self is PLAIN else repr(self).encode()

    @property
    def over(self) -> bool:
        """Whether the prim is somebody else's: only moved, not defined."""
        return bool(self.prim_path) and not self.proxy

    @property
    def order(self) -> tuple[str, ...]:
        """The operations, as `xformOpOrder` lists them and as Omniverse writes them."""
        return _PLAIN if self.pivot is None else _PIVOTED

    def beside(self, number: int) -> Placement:
        """The same for the rover of this number in a fleet, from 0."""
        if not self.spacing_m or not number:
            return self
        right = number * self.spacing_m
        cosine, sine = self._turn(self.heading_deg)
        across = self._axes(right * sine, -right * cosine, 0.0)
        x, y, z = (at + more for at, more in zip(self.origin_m, across, strict=True))
        return replace(self, origin_m=(float(x), float(y), float(z)))

    def translations(self, across_m: Array, up_m: Array) -> Axes:
        """Values of `xformOp:translate` in units and axes of the stage; numbers where they do not change."""
        cosine, sine = self._turn(self.heading_deg)
        ahead = self._axes(across_m * cosine, across_m * sine if sine else 0.0, up_m)
        pivot = self.pivot or (0.0, 0.0, 0.0)
        x, y, z = (
            (origin + more) / self.meters_per_unit - point
            for origin, more, point in zip(self.origin_m, ahead, pivot, strict=True)
        )
        return x, y, z

    def orientations(self, pitch_deg: Array) -> tuple[float | Array, Axes]:
        """Real and imaginary parts of `xformOp:orient`: first nose up by `pitch_deg`, then to the heading."""
        half = np.radians(pitch_deg) / 2.0
        cosine, sine = np.cos(half), np.sin(half)
        along, aside = self._turn(self.heading_deg / 2.0)
        return along * cosine, self._axes(aside * sine if aside else 0.0, -along * sine, aside * cosine)

    def _axes(self, x: float | Array, y: float | Array, z: float | Array) -> Axes:
        """A vector of the twin's world along the axes of the stage."""
        return (x, y, z) if self.up_axis == "Z" else (x, z, -y)

    @staticmethod
    def _turn(angle_deg: float) -> tuple[float, float]:
        """Cosine and sine, exact for no turn at all."""
        angle = math.radians(angle_deg)
        return (math.cos(angle), math.sin(angle)) if angle_deg else (1.0, 0.0)


PLAIN = Placement()
"""A rover of our own on a Z-up stage in metres."""


def fleet_paths(placement: Placement, indices: list[int]) -> Iterator[str]:
    """A path for each rover of a fleet, by its place among those that were asked for."""
    base = placement.prim_path or "/Rovers/Rover"
    return (f"{base}_{index}" for index in indices)
