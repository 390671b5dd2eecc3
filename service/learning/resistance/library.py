"""The compiled engine (`native/`), as functions of arrays: finding it, its structs, and what it must be given.

It is called by ctypes, which lets other threads run meanwhile. Nothing is loaded before the first call.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array

PATH = Path(__file__).with_name("native") / "librover.so"
INTERFACE = 3  # ROVER_INTERFACE of native/engine.h
LANES = 16  # ROVER_LANES
_REMEDY = "run `pip install .` (or `pip install --editable .`, or `make run`) again in the checkout: that compiles it"
_BAD_TIME = 2  # ROVER_BAD_TIME; all else that is not 0 is a lack of memory

_INTEGER, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_Fields = list[tuple[str, type]]


def _numbers(names: str) -> _Fields:
    return [(name, _NUMBER) for name in names.split()]


class Curve(ctypes.Structure):
    """`rover_curve`."""

    _fields_: ClassVar[_Fields] = _numbers("adhesion plateau slip_scale load_exponent linear backing_loss backing_slip")


class Body(ctypes.Structure):
    """`rover_body`."""

    _fields_: ClassVar[_Fields] = _numbers(
        "wheelbase_m centre_ahead_m centre_height_m height_rise_m unladen_mass_kg share_shift"
    )


class Gate(ctypes.Structure):
    """`rover_gate`."""

    _fields_: ClassVar[_Fields] = _numbers("margin torque mass width")


class Laws(ctypes.Structure):
    """`rover_laws`."""

    _fields_: ClassVar[_Fields] = [
        ("vector_bits", _INTEGER),
        ("body", Body),
        *_numbers("rim_speed_m_s reference_mass_kg mass_exponent mean_resistance"),
        *_numbers("sticking_margin sticking_width sticking_wheel_m_s sticking_speed_m_s margin_speed_m_s"),
        ("curves", Curve * 3),
        ("slip_count", _INTEGER),
        ("slips", _POINTER),
        ("speed_count", _INTEGER),
        ("speeds_m_s", _POINTER),
    ]


class Knots(ctypes.Structure):
    """`rover_knots`."""

    _fields_: ClassVar[_Fields] = [
        *_numbers("first_m step_m"),
        ("cell_count", _INTEGER),
        ("knot_count", _INTEGER),
        ("knot", _POINTER),
        ("number", _POINTER),
        ("inverse", _POINTER),
    ]


class Process(ctypes.Structure):
    """`rover_process`."""

    _fields_: ClassVar[_Fields] = [
        ("shape", _INTEGER * 5),
        ("variance", _NUMBER * 5),
        *_numbers("stall_level_variance stall_travel_variance"),
        ("level_inverse_square", _NUMBER * 3),
        ("travel_inverse_square", _NUMBER * 3),
        *((name, _POINTER) for name in ("level", "rut", "travel", "plateau", "time")),
        ("knots", Knots),
        ("time_count", _INTEGER),
        ("time_s", _POINTER),
        ("time_inverse", _POINTER),
    ]


class Model(ctypes.Structure):
    """`rover_model`."""

    _fields_: ClassVar[_Fields] = [
        ("laws", Laws),
        ("stall_gate", Gate),
        ("gravity_m_s2", _NUMBER),
        *((name, _INTEGER) for name in ("run_count", "shape_count", "refine")),
        ("low", _NUMBER * 3),
        ("high", _NUMBER * 3),
        *_numbers("feature_margin mass_reach"),
        *((name, _POINTER) for name in ("features", "gate", "half_inverse_square", "blend")),
        *((name, _POINTER) for name in ("start_features", "start_weights")),
        ("start_mean", _NUMBER * 2),
        ("start_inverse_lengths", _NUMBER * 2),
        ("resistance", Process),
        ("height", Process),
    ]


# The engine's types by name, whose sizes are compared when it is loaded. A row is one of a block of tables.
_STRUCTS = Curve, Body, Gate, Laws, Knots, Process, Model
MIRRORS = {"rover_row": _NUMBER * LANES} | {f"rover_{each.__name__.lower()}": each for each in _STRUCTS}

# Everything but integers and numbers is the address of an array of float64, or of a struct, or `first` of an array.
_FIRST = ctypes.POINTER(_NUMBER)
_ARGUMENTS: dict[str, tuple[list[type], type | None]] = {
    "rover_interface": ([], _INTEGER),
    "rover_bytes": ([ctypes.c_char_p], _INTEGER),
    "rover_vector_bits": ([], _INTEGER),
    "rover_predict": ([_POINTER, _INTEGER, _FIRST, _INTEGER, _FIRST, _INTEGER, _FIRST], _INTEGER),
    "rover_step_times": ([_NUMBER, _INTEGER, _INTEGER, _POINTER], _INTEGER),
    "rover_tabulate_laws": ([_POINTER, _INTEGER, *[_POINTER] * 7], _INTEGER),
    "rover_axle_shares": ([_POINTER, _NUMBER, _NUMBER, _POINTER, _POINTER], None),
    "rover_traction": ([_POINTER, _INTEGER, _POINTER, _POINTER, _NUMBER, _NUMBER, _POINTER], None),
    "rover_mean_shear": ([_INTEGER, _POINTER, _POINTER], None),
    "rover_scaled_features": ([_INTEGER, *[_POINTER] * 3, _NUMBER, _POINTER], None),
    "rover_stall_gate": ([_POINTER, _INTEGER, *[_POINTER] * 3], None),
    "rover_start_features": ([_INTEGER, *[_POINTER] * 3], None),
    "rover_start_shape": ([_POINTER, _INTEGER, _POINTER, _INTEGER, _POINTER, _POINTER], None),
}


@cache
def library() -> ctypes.CDLL:
    """The engine at PATH, loaded once. Raises ImportError, with the remedy, for one that is missing or does not fit."""
    try:
        loaded = ctypes.CDLL(str(PATH))
    except OSError as error:
        raise ImportError(f"the compiled engine {PATH} cannot be loaded ({error}): {_REMEDY}") from error
    try:
        if (found := loaded.rover_interface()) != INTERFACE:
            raise ImportError(f"the compiled engine {PATH} has interface {found}, needed is {INTERFACE}: {_REMEDY}")
        for name, (arguments, answer) in _ARGUMENTS.items():
            function = getattr(loaded, name)
            function.argtypes, function.restype = arguments, answer
    except AttributeError as error:
        raise ImportError(f"the compiled engine {PATH} is another program's ({error}): {_REMEDY}") from error
    for name, mirror in MIRRORS.items():
        if (found := loaded.rover_bytes(name.encode())) != (needed := ctypes.sizeof(mirror)):
            raise ImportError(f"{name} of the compiled engine {PATH} has {found} bytes, needed are {needed}: {_REMEDY}")
    return loaded


@cache
def vector_bits() -> int:
    """How wide this machine's vectors are. Wider ones give the same answers sooner."""
    return int(library().rover_vector_bits())


def require_success(status: int) -> None:
    """Turns what the engine answers into an exception: MemoryError, or ValueError for times that are not finite."""
    if status == _BAD_TIME:
        raise ValueError("times must be finite")
    if status:
        raise MemoryError("there is not enough memory for so long a horizon")


def first(array: Array) -> ctypes.c_double:
    """The first number of a contiguous array that is not empty: to be handed over, which is sooner than by address."""
    if array.flags.writeable:
        return _NUMBER.from_buffer(array)  # type: ignore[arg-type] # arrays are buffers
    return _NUMBER.from_address(address(array))


def address(array: npt.NDArray[np.float64] | npt.NDArray[np.int32]) -> int:
    """Where a contiguous array lies. It must be kept as long as the address is used."""
    return int(array.__array_interface__["data"][0])


def contiguous(array: Array | float) -> Array:
    """As aligned float64 in one piece, which is what the engine reads."""
    found = np.ascontiguousarray(array, dtype=np.float64)
    return found if found.flags.aligned else found.copy()
