"""The libraries that `hatch_build.py` compiles, and where each version of FMI wants them in the archive.

FMI 2 knows no processors: what it calls darwin64 is one file for both of Apple's, and Linux on ARM has no name, so it
gets the one of FMI 3.
"""

from __future__ import annotations

import hashlib
import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from service.errors import RoverTwinError

FOLDER = Path(__file__).with_name("native")
_REMEDY = "run `pip install .` (or `pip install --editable .`, or `make run`) again in the checkout: that compiles them"


class FmuLibraryError(RoverTwinError):
    """A library for FMUs is missing; the message has the remedy."""


@dataclass(frozen=True, slots=True)
class Platform:
    """One library: its file here, its folder in FMI 3, and its folder in FMI 2 ("" where it is part of another)."""

    file: str
    fmi3: str
    fmi2: str

    @property
    def suffix(self) -> str:
        """Of the file in the archive."""
        return Path(self.file).suffix


PLATFORMS = (
    Platform("x86_64-linux.so", "x86_64-linux", "linux64"),
    Platform("aarch64-linux.so", "aarch64-linux", "aarch64-linux"),
    Platform("x86_64-windows.dll", "x86_64-windows", "win64"),
    Platform("x86_64-darwin.dylib", "x86_64-darwin", ""),
    Platform("aarch64-darwin.dylib", "aarch64-darwin", ""),
)
_UNIVERSAL = ("x86_64-darwin.dylib", "aarch64-darwin.dylib")

_FAT_MAGIC, _ALIGN = 0xCAFEBABE, 14  # big-endian; each part begins at a multiple of 2**14 bytes, Apple's pages
_PROCESSOR = struct.Struct("<4xII")  # of a Mach-O file: processor and its kind


@cache
def library(file: str) -> bytes:
    """One of the libraries. Raises FmuLibraryError when it is missing."""
    try:
        return (FOLDER / file).read_bytes()
    except OSError as error:
        raise FmuLibraryError(f"the library {FOLDER / file} for FMUs cannot be read ({error}): {_REMEDY}") from error


def binaries(fmi: str) -> dict[str, bytes]:
    """Libraries by folder and suffix, `linux64/.so`, for "2.0" or "3.0"."""
    if fmi == "3.0":
        return {f"{each.fmi3}/{each.suffix}": library(each.file) for each in PLATFORMS}
    known = {f"{each.fmi2}/{each.suffix}": library(each.file) for each in PLATFORMS if each.fmi2}
    return known | {"darwin64/.dylib": universal([library(file) for file in _UNIVERSAL])}


@cache
def digest() -> str:
    """Of all libraries."""
    found = hashlib.sha256()
    for each in PLATFORMS:
        found.update(hashlib.sha256(library(each.file)).digest())
    return found.hexdigest()


def universal(parts: list[bytes]) -> bytes:
    """One file for several of Apple's processors, from a library for each (Mach-O's "fat" form)."""
    head, body = struct.pack(">II", _FAT_MAGIC, len(parts)), b""
    start = 1 << _ALIGN
    for part in parts:
        processor, kind = _PROCESSOR.unpack_from(part)
        at = start + len(body)
        head += struct.pack(">IIIII", processor, kind, at, len(part), _ALIGN)
        body += part + bytes(-len(part) % start)
    return head + bytes(start - len(head)) + body
