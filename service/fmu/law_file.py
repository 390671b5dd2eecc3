"""The law of a drive model as `resources/law.bin`, which `native/law_file.c` reads."""

from __future__ import annotations

import ctypes
import struct
import zlib

import numpy as np

from service.learning.drive.law import LaidOutLaw
from service.learning.drive.library import HEIGHTS, INTERFACE, Basis, Parameters
from service.learning.drive.model import DriveModel
from service.physics.scenario import Array

NAME = "law.bin"
FORMAT = 1  # FMU_LAW_FORMAT of native/law_file.h
TOKEN_BYTES = 64  # FMU_TOKEN_BYTES
_HEAD = struct.Struct("<4sIIIQ")  # magic, format, checksum, interface of the engine, numbers


def law_bytes(model: DriveModel, token: str) -> bytes:
    """Everything that moves a rover, as the engine has it, under the token of the model description.

    Raises ValueError for a token that has no room.
    """
    if len(token.encode()) > TOKEN_BYTES:
        raise ValueError(f"a token has {TOKEN_BYTES} bytes at most, got {token!r}")
    numbers = np.concatenate([_law(model), _release_speeds(model)]).astype("<f8")
    body = token.encode().ljust(TOKEN_BYTES, b"\0") + numbers.tobytes()
    return _HEAD.pack(b"RVLW", FORMAT, zlib.crc32(body), INTERFACE, len(numbers)) + body


def _law(model: DriveModel) -> Array:
    laid_out = LaidOutLaw(model.law)
    law = laid_out.struct
    scalars = [law.number, law.gravity_m_s2, law.wheel_radius_m, law.wheelbase_m, law.centre_ahead_m]
    scalars += [law.centre_height_m, law.rim_speed_m_s, *law.reach]
    weights = 2 * law.motion.count + law.stall.count
    return np.concatenate(
        [
            scalars,
            *_basis(law.motion),
            *_basis(law.stall),
            _at(law.parameters, ctypes.sizeof(Parameters) // 8),
            _at(law.weights, weights),
            _at(law.heights, HEIGHTS),
        ]
    )


def _basis(basis: Basis) -> tuple[Array, Array]:
    return np.array([basis.count, *basis.scale], dtype=np.float64), _at(basis.centres, 3 * basis.count)


def _at(address: int, count: int) -> Array:
    return np.array((ctypes.c_double * count).from_address(address), dtype=np.float64)


def _release_speeds(model: DriveModel) -> Array:
    release = model.starts.compiled()
    slopes, masses = release.slopes, release.masses
    head = [slopes, masses, release.slope_length_deg, release.mass_length, *release.slope_rad, *release.mass_kg]
    parts = (release.slope_deg, slopes), (release.log_mass, masses), (release.weights, slopes * masses)
    return np.concatenate([head, *(_at(*part) for part in parts)])
