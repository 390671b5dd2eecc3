"""The numbers of the equation of motion, whose formulas are in `native/law.c` (and, for tests, in `reference.py`).

Slope, torque and mass act through three features (`scaled_features`), two bases of Gaussian bumps over them, and their
weights: of what the moving rover's resistance has beyond the closed form, what ruts add to that, and what holds a rover
that barely moves.
"""

from __future__ import annotations

import ctypes
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from service.learning.drive.library import HEIGHTS, CompiledLaw, Parameters, address, contiguous, vector_bits
from service.learning.drive.library import Basis as CompiledBasis
from service.physics.parameters import RegolithParameters, RoverParameters
from service.physics.scenario import Array

_LANES = 8  # of native/law.c: bases come in multiples of these
_NUMBER_BITS = 48  # a law's number is a whole one that a float64 holds

_ANYWHERE = (-100.0, 100.0)  # of a scaled feature


def _names() -> tuple[str, ...]:
    found: list[str] = []
    for name, kind in Parameters._fields_:
        count = ctypes.sizeof(kind) // ctypes.sizeof(ctypes.c_double)
        found += [f"{name}_{i}" for i in range(count)] if count > 1 else [name]
    return tuple(found)


PARAMETERS = (
    _names()
)  # in the order of the vector; `dig_0` to `dig_3` are numbers of an affine function of the features


def scaled_features(slope_rad: Array, torque_ratio: Array, mass_kg: Array) -> Array:
    """tan(slope), ln(torque ratio), ln(mass), each centred and scaled; (..., 3). The ratio is to weight by radius."""
    columns = (
        (np.tan(slope_rad) - 0.27) / 0.19,
        np.log((np.asarray(torque_ratio) + 0.05) / 0.37) / 0.55,
        np.log(np.asarray(mass_kg) / 550.0) / 0.33,
    )
    return np.stack(np.broadcast_arrays(*columns), axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """exp(-sum ((features - centre) / length)^2 / 2) for each centre (bump, 3); lengths (3,).

    Raises ValueError for shapes that do not fit, numbers that are not finite and lengths that are not positive.
    """

    centres: Array
    lengths: Array

    def __post_init__(self) -> None:
        if self.centres.ndim != 2 or self.centres.shape[1:] != (3,) or np.shape(self.lengths) != (3,):
            raise ValueError(f"a basis needs centres (bump, 3) and lengths (3,), got {self.centres.shape}")
        if not (np.isfinite(self.centres).all() and np.isfinite(self.lengths).all() and np.min(self.lengths) > 0):
            raise ValueError("a basis needs finite centres and positive lengths")

    def __len__(self) -> int:
        return len(self.centres)

    @property
    def padded(self) -> int:
        """How many bumps the engine has: some more, without weight."""
        return -(-len(self) // _LANES) * _LANES


@dataclass(frozen=True, eq=False)
class Law:
    """A whole law. `parameters` (len(PARAMETERS),), `weights` (2 len(motion) + len(stall),), `heights` (HEIGHTS,): what
    the height of the rear wheel centre is made of. `reach` (3, 2): lowest and highest of each scaled feature that runs
    have shown; beyond, what was learned stays as it is at the edge.

    Raises ValueError for shapes that do not fit and numbers that are not finite.
    """

    rover: RoverParameters
    regolith: RegolithParameters
    parameters: Array
    motion: Basis
    stall: Basis
    weights: Array
    heights: Array = field(default_factory=lambda: np.zeros(HEIGHTS))
    reach: Array = field(default_factory=lambda: np.array([_ANYWHERE] * 3))

    def __post_init__(self) -> None:
        if np.shape(self.parameters) != (len(PARAMETERS),) or np.shape(self.weights) != (self.weight_count,):
            raise ValueError(
                f"a law needs {len(PARAMETERS)} parameters and {self.weight_count} weights,"
                f" got shapes {np.shape(self.parameters)} and {np.shape(self.weights)}"
            )
        if np.shape(self.reach) != (3, 2) or not (np.isfinite(self.reach).all() and (np.diff(self.reach) >= 0).all()):
            raise ValueError("a law needs a lowest and a highest value of each feature")
        if np.shape(self.heights) != (HEIGHTS,):
            raise ValueError(f"a law needs {HEIGHTS} numbers for heights, got shape {np.shape(self.heights)}")
        if not all(np.isfinite(each).all() for each in (self.parameters, self.weights, self.heights)):
            raise ValueError("a law needs finite parameters, weights and heights")

    @classmethod
    def of(
        cls,
        rover: RoverParameters,
        regolith: RegolithParameters,
        parameters: Mapping[str, float],
        motion: Basis,
        stall: Basis,
        weights: Array,
        heights: Array | None = None,
    ) -> Law:
        """With parameters by name. Raises ValueError unless these are PARAMETERS."""
        if set(parameters) != set(PARAMETERS):
            raise ValueError(f"not the parameters of a law: {sorted(set(parameters) ^ set(PARAMETERS))}")
        vector = np.array([parameters[name] for name in PARAMETERS], dtype=np.float64)
        return cls(rover, regolith, vector, motion, stall, weights, np.zeros(HEIGHTS) if heights is None else heights)

    @property
    def weight_count(self) -> int:
        """How many weights the bases need."""
        return 2 * len(self.motion) + len(self.stall)

    @property
    def named(self) -> dict[str, float]:
        """Parameters by name."""
        return dict(zip(PARAMETERS, map(float, self.parameters), strict=True))

    @cached_property
    def number(self) -> int:
        """Tells laws apart; the same numbers have the same one."""
        rover, soil = self.rover, self.regolith
        body = [rover.wheel_radius_m, rover.wheelbase_m, rover.centre_of_mass_ahead_of_rear_axle_m]
        body += [rover.centre_of_mass_height_m, rover.no_load_speed_rad_s, soil.gravity_m_s2]
        digest = hashlib.blake2b(digest_size=_NUMBER_BITS // 8)
        for array in (
            np.array(body),
            self.parameters,
            *(each for basis in (self.motion, self.stall) for each in (basis.centres, basis.lengths)),
            self.weights,
            self.heights,
            self.reach,
        ):
            numbers = np.ascontiguousarray(array, dtype="<f8")
            digest.update(np.array(numbers.shape, dtype="<i8").tobytes() + numbers.tobytes())
        return int.from_bytes(digest.digest(), "little")

    def padded_weights(self, weights: Array) -> Array:
        """Weights (..., weight_count) as the engine has them."""
        n, m = len(self.motion), len(self.stall)
        parts = weights[..., :n], weights[..., n : 2 * n], weights[..., 2 * n :]
        rooms = self.motion.padded - n, self.motion.padded - n, self.stall.padded - m
        plain = [(0, 0)] * (weights.ndim - 1)
        return np.concatenate([np.pad(p, [*plain, (0, room)]) for p, room in zip(parts, rooms, strict=True)], axis=-1)


class LaidOutLaw:
    """A law as the engine reads it: keeps the arrays whose addresses are in the struct, which nobody changes.

    Without `heights` the engine spends no time on them: all are 0.
    """

    def __init__(self, law: Law, *, heights: bool = True) -> None:
        self._kept: list[Array] = []
        rover = law.rover
        self.struct = CompiledLaw(
            vector_bits=vector_bits(),
            number=float(law.number),
            gravity_m_s2=law.regolith.gravity_m_s2,
            wheel_radius_m=rover.wheel_radius_m,
            wheelbase_m=rover.wheelbase_m,
            centre_ahead_m=rover.centre_of_mass_ahead_of_rear_axle_m,
            centre_height_m=rover.centre_of_mass_height_m,
            reach=tuple(map(float, np.ravel(law.reach))),
            rim_speed_m_s=rover.no_load_speed_rad_s * rover.wheel_radius_m,
            motion=self._basis(law.motion),
            stall=self._basis(law.stall),
            parameters=self._keep(law.parameters),
            weights=self._keep(law.padded_weights(law.weights)),
            heights=self._keep(law.heights) if heights else None,
        )
        self.address = ctypes.addressof(self.struct)

    def _basis(self, basis: Basis) -> CompiledBasis:
        scale = np.sqrt(0.5) / np.asarray(basis.lengths, dtype=np.float64)
        centres = np.zeros((3, basis.padded))
        centres[:, : len(basis)] = (basis.centres * scale).T
        return CompiledBasis(count=basis.padded, scale=tuple(scale), centres=self._keep(centres))

    def _keep(self, array: Array) -> int:
        kept = contiguous(array).copy()
        self._kept.append(kept)
        return address(kept)
