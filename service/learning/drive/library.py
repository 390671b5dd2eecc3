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
INTERFACE = 5  # ROVER_INTERFACE of native/engine.h
RUT_CELLS = 64  # ROVER_RUT_CELLS
MOST_S = 1e6  # ROVER_MOST_S
HEIGHTS = 37  # ROVER_HEIGHTS
OUTPUTS = 6  # ROVER_OUTPUTS
_REMEDY = "run `pip install .` (or `pip install --editable .`, or `make run`) again in the checkout: that compiles it"

_INTEGER, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_Fields = list[tuple[str, type]]


def _numbers(names: str) -> _Fields:
    """Fields of one number, or of several: `name[4]`."""
    parts = (name.rstrip("]").partition("[") for name in names.split())
    return [(name, _NUMBER * int(count) if count else _NUMBER) for name, _, count in parts]


class Parameters(ctypes.Structure):
    """`rover_parameters`."""

    _fields_: ClassVar[_Fields] = [
        *_numbers("front_adhesion front_plateau front_slip_scale front_load_exponent front_linear"),
        *_numbers("rear_adhesion rear_plateau rear_slip_scale rear_load_exponent rear_linear"),
        *_numbers("rut_adhesion rut_plateau rut_slip_scale rut_load_exponent rut_slip_shift"),
        *_numbers("compaction compaction_exponent compaction_bend compaction_adhesion"),
        *_numbers("share_shift height_rise_m rut_begin_m rut_end_m front_in_rut"),
        *_numbers("shear_lack shear_slip_m backing_relief backing_length_m"),
        *_numbers("resistance rut_resistance compaction_resistance front_rut_resistance speed_resistance"),
        *_numbers("mass_exponent dig_length_m dig[4] near near_length_m far far_length_m early[28] along[21] back[7]"),
        *_numbers("turning_speed_m_s free_resistance free_rut_relief free_ratio"),
        *_numbers("back_resistance back_rut_relief back_spin_relief back_spin_m_s"),
        *_numbers("back_hold_relief back_hold_length_m gate_speed_m_s gate_width_m_s"),
        *_numbers("slip_lag_m brake_friction brake_speed_m_s"),
    ]


class Basis(ctypes.Structure):
    """`rover_basis`."""

    _fields_: ClassVar[_Fields] = [("count", _INTEGER), ("scale", _NUMBER * 3), ("centres", _POINTER)]


class CompiledLaw(ctypes.Structure):
    """`rover_law`."""

    _fields_: ClassVar[_Fields] = [
        ("vector_bits", _INTEGER),
        *_numbers(
            "number gravity_m_s2 wheel_radius_m wheelbase_m centre_ahead_m centre_height_m rim_speed_m_s reach[6]"
        ),
        ("motion", Basis),
        ("stall", Basis),
        ("parameters", _POINTER),
        ("weights", _POINTER),
        ("heights", _POINTER),
    ]


class CompiledState(ctypes.Structure):
    """`rover_state`."""

    _fields_: ClassVar[_Fields] = [
        *_numbers("format law mass_kg time_s x_m speed_m_s event_s slip_path_m path_m dig furthest_m lowest_m"),
        *_numbers(
            "front_slip frontier_m front_rim_m_s rear_rim_m_s cut_s cell_s within_s slope_rad torque_nm brake offset"
        ),
        *_numbers("acceleration_m_s2 rate_per_s front_rad_s rear_rad_s front_by_speed rear_by_speed"),
        *_numbers("height_known height_m next_height_m"),
        ("ruts", _NUMBER * RUT_CELLS),
    ]


class CompiledTrack(ctypes.Structure):
    """`rover_track`."""

    _fields_: ClassVar[_Fields] = [("count", _INTEGER), ("distance_m", _POINTER), ("slope_rad", _POINTER)]


class CompiledControls(ctypes.Structure):
    """`rover_controls`."""

    _fields_: ClassVar[_Fields] = [("count", _INTEGER), *((n, _POINTER) for n in ("time_s", "torque_nm", "brake"))]


class CompiledRun(ctypes.Structure):
    """`rover_run`."""

    _fields_: ClassVar[_Fields] = [
        *_numbers("mass_kg start_speed_m_s"),
        ("track", CompiledTrack),
        ("controls", CompiledControls),
        ("times", _INTEGER),
        ("time_s", _POINTER),
        ("force_every", _INTEGER),
        ("observed_x_m", _POINTER),
        ("observed_speed_m_s", _POINTER),
    ]


class CompiledRelease(ctypes.Structure):
    """`rover_release`."""

    _fields_: ClassVar[_Fields] = [
        ("slopes", _INTEGER),
        ("masses", _INTEGER),
        *_numbers("slope_length_deg mass_length slope_rad[2] mass_kg[2]"),
        *((name, _POINTER) for name in ("slope_deg", "log_mass", "weights")),
    ]


class CompiledWholes(ctypes.Structure):
    """`rover_wholes`."""

    _fields_: ClassVar[_Fields] = [
        ("horizon_s", _POINTER),
        ("looks", _INTEGER),
        *_numbers("look_s[2]"),
        ("numbers", _POINTER),
    ]


class CompiledTimetable(ctypes.Structure):
    """`rover_timetable`."""

    _fields_: ClassVar[_Fields] = [
        ("times", _INTEGER),
        ("time_s", _POINTER),
        ("shown", _INTEGER),
        ("shown_places", _POINTER),
        ("own", _INTEGER),
        ("own_places", _POINTER),
        ("late", _INTEGER),
        ("looks", _INTEGER),
        ("look_places", _POINTER),
    ]


# The engine's types by name, whose sizes are compared when it is loaded.
MIRRORS: dict[str, type[ctypes.Structure]] = {
    "rover_parameters": Parameters,
    "rover_basis": Basis,
    "rover_law": CompiledLaw,
    "rover_state": CompiledState,
    "rover_track": CompiledTrack,
    "rover_controls": CompiledControls,
    "rover_run": CompiledRun,
    "rover_release": CompiledRelease,
    "rover_wholes": CompiledWholes,
    "rover_timetable": CompiledTimetable,
}

# Everything but integers and numbers is the address of an array of float64 (offsets: int64), or of a struct.
_ARGUMENTS: dict[str, tuple[list[type], type | None]] = {
    "rover_interface": ([], _INTEGER),
    "rover_state_format": ([], _INTEGER),
    "rover_bytes": ([ctypes.c_char_p], _INTEGER),
    "rover_vector_bits": ([], _INTEGER),
    "rover_release_speeds": ([_POINTER, _INTEGER, *[_POINTER] * 3], None),
    "rover_start": ([_POINTER, _NUMBER, _NUMBER, _POINTER], None),
    "rover_present": ([_INTEGER, _POINTER, _POINTER], None),
    "rover_drive": ([*[_POINTER] * 4, _NUMBER, _INTEGER, _POINTER, _POINTER], None),
    "rover_constant": ([_POINTER, _INTEGER, _POINTER, _INTEGER, _POINTER, _INTEGER, _POINTER], None),
    "rover_side_by_side": (
        [*[_POINTER, _INTEGER] * 4, _INTEGER, *[_POINTER] * 2],
        None,
    ),
    "rover_scenario": ([*[_POINTER] * 3, *[_NUMBER] * 3, _INTEGER, *[_POINTER] * 2], None),
    "rover_nearest": ([_INTEGER, _POINTER, *[_NUMBER] * 3, _INTEGER, _POINTER], None),
    "rover_step": ([_POINTER, _INTEGER, *[_POINTER] * 4], None),
    "rover_step_fleet": ([_POINTER, _INTEGER, *[_POINTER] * 3], None),
    "rover_sweep": ([_POINTER, _INTEGER, _INTEGER, _POINTER, _INTEGER, _POINTER, _POINTER, _INTEGER, _POINTER], None),
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


def address(array: npt.NDArray[np.float64] | npt.NDArray[np.int64]) -> int:
    """Where a contiguous array lies. It must be kept as long as the address is used."""
    if array.flags.writeable and array.size:
        return ctypes.addressof(ctypes.c_char.from_buffer(array.data))  # in a quarter of the time
    return int(array.ctypes.data)


def contiguous(array: Array | float) -> Array:
    """As aligned float64 in one piece, which is what the engine reads."""
    found = np.ascontiguousarray(array, dtype=np.float64)
    return found if found.flags.aligned else found.copy()
