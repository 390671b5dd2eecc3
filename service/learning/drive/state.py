"""State of a rover on its way: everything that its future depends on, besides slope, torque and brake."""

from __future__ import annotations

import ctypes
import hashlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from service.learning.drive.library import OUTPUTS, CompiledState, address, contiguous, library
from service.physics.scenario import Array

_FIELDS = [name for name, _ in CompiledState._fields_]
SIZE = ctypes.sizeof(CompiledState) // 8  # numbers of a state
_AT = {name: at for at, name in enumerate(_FIELDS)}
FORMAT = 1  # ROVER_STATE_FORMAT of native/engine.h
_MAGIC = b"RVST"
_HEAD = struct.Struct("<4sHH")  # magic, format, numbers
_DIGEST_BYTES = 8


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """One state, as its `numbers` (SIZE,), which nobody changes."""

    numbers: Array

    def __eq__(self, other: object) -> bool:
        return isinstance(other, State) and self.to_bytes() == other.to_bytes()

    def __hash__(self) -> int:
        return hash(self.to_bytes())

    def _number(self, name: str) -> float:
        return float(self.numbers[_AT[name]])

    def _now(self) -> Array:
        outputs = np.empty(OUTPUTS)
        library().rover_present(1, address(self.numbers), address(outputs))
        return outputs

    @property
    def law(self) -> int:
        """Number of the law that it belongs to."""
        return int(self._number("law"))

    @property
    def mass_kg(self) -> float:
        """Mass of the whole rover, kg."""
        return self._number("mass_kg")

    @property
    def time_s(self) -> float:
        """Since the start, s."""
        return self._number("time_s")

    @property
    def x_m(self) -> float:
        """Position of the rear wheel along the track, m from where it started."""
        return float(self._now()[0])

    @property
    def speed_m_s(self) -> float:
        """Speed along the track, m/s."""
        return float(self._now()[1])

    @property
    def y_m(self) -> float:
        """Height of the rear wheel centre above the undeformed surface, m."""
        return float(self._now()[4])

    @property
    def front_wheel_rad_s(self) -> float:
        """Speed of the front wheels, rad/s."""
        return float(self._now()[2])

    @property
    def rear_wheel_rad_s(self) -> float:
        """Speed of the rear wheels, rad/s."""
        return float(self._now()[3])

    def to_bytes(self) -> bytes:
        """To be sent or kept; the same state has the same bytes on every machine."""
        body = _HEAD.pack(_MAGIC, FORMAT, SIZE) + self.numbers.astype("<f8").tobytes()
        return body + hashlib.blake2b(body, digest_size=_DIGEST_BYTES).digest()

    @classmethod
    def from_bytes(cls, data: bytes) -> State:
        """What `to_bytes` made. Raises ValueError for anything else, says what it is if that can be known."""
        if len(data) < _HEAD.size or data[:4] != _MAGIC:
            raise ValueError("this is not the state of a rover")
        _, version, size = _HEAD.unpack_from(data)
        if version != FORMAT:
            raise ValueError(f"the state has format {version}, this version reads format {FORMAT}: start anew")
        body, digest = data[:-_DIGEST_BYTES], data[-_DIGEST_BYTES:]
        if size != SIZE or len(data) != _HEAD.size + 8 * SIZE + _DIGEST_BYTES:
            raise ValueError("the state is cut off, or something was added to it")
        if hashlib.blake2b(body, digest_size=_DIGEST_BYTES).digest() != digest:
            raise ValueError("the state was altered on its way: its checksum is another one")
        numbers = np.frombuffer(body, dtype="<f8", offset=_HEAD.size).astype(np.float64)
        if not np.isfinite(numbers).all():
            raise ValueError("the state has numbers that are not finite")
        return cls(numbers)


def states_array(states: Sequence[State] | Array) -> Array:
    """States as numbers (rover, SIZE). Raises ValueError for an array of another shape."""
    if isinstance(states, np.ndarray):
        if states.ndim != 2 or states.shape[1] != SIZE:
            raise ValueError(f"states must be (rover, {SIZE}), got {states.shape}")
        return contiguous(states)
    return np.array([state.numbers for state in states]).reshape(-1, SIZE)
