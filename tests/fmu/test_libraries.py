"""The libraries in an FMU: those for other machines cannot be run here, but be looked at."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from service.fmu.platforms import PLATFORMS, FmuLibraryError, binaries, library, universal
from tests.fmu.headers import inspect, parts

ROOT = Path(__file__).parents[2]
EXPECTED = {
    "x86_64-linux.so": ("ELF", "x86_64", {"libc.so.6", "libm.so.6"}),
    "aarch64-linux.so": ("ELF", "aarch64", {"libc.so.6", "libm.so.6"}),
    "x86_64-windows.dll": ("PE", "x86_64", {"kernel32.dll"}),
    "x86_64-darwin.dylib": ("Mach-O", "x86_64", {"/usr/lib/libSystem.B.dylib"}),
    "aarch64-darwin.dylib": ("Mach-O", "aarch64", {"/usr/lib/libSystem.B.dylib"}),
}
FILES = [each.file for each in PLATFORMS]


@pytest.mark.parametrize("file", FILES)
def test_each_is_for_its_machine_and_needs_the_system_alone(file):
    found = inspect(library(file))
    assert (found.kind, found.processor, set(found.needed)) == EXPECTED[file]
    assert not found.executable_stack
    assert found.oldest in {"ELF": ("GLIBC_2.14", "GLIBC_2.17"), "PE": ("",), "Mach-O": ("11.0",)}[found.kind]
    assert found.signed == (file == "aarch64-darwin.dylib") or found.kind == "Mach-O"


@pytest.mark.parametrize("file", FILES)
def test_each_exports_the_standards_functions_alone(file):
    exports = inspect(library(file)).exports
    assert all(name.startswith(("fmi2", "fmi3")) for name in exports)
    assert exports == inspect(library(FILES[0])).exports


def test_the_functions_are_all_that_importers_look_for():
    """FMPy knows every function of the standard by name."""
    from fmpy.fmi2 import FMU2Model, FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    exports = inspect(library(FILES[0])).exports
    two = {name for name in {*dir(FMU2Slave), *dir(FMU2Model)} if name.startswith("fmi2") and name[4].isupper()}
    three = {name for name in dir(FMU3Slave) if name.startswith("fmi3") and name[4].isupper()}
    assert len(two) > 30
    assert len(three) > 70
    assert two | three <= exports


def test_apples_processors_share_one_file_in_fmi_2():
    both = parts(binaries("2.0")["darwin64/.dylib"])
    assert both == [library("x86_64-darwin.dylib"), library("aarch64-darwin.dylib")]
    assert [inspect(each).processor for each in both] == ["x86_64", "aarch64"]


def test_an_empty_universal_file_is_its_head():
    assert universal([]).startswith(b"\xca\xfe\xba\xbe\0\0\0\0")


def test_the_install_makes_all_that_is_exported():
    """`hatch_build.py` runs where nothing of ours is installed, so it has its own list."""
    tree = ast.parse((ROOT / "hatch_build.py").read_text())
    words = {each.value for each in ast.walk(tree) if isinstance(each, ast.Constant) and isinstance(each.value, str)}
    assert set(FILES) <= words


def test_a_missing_library_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setattr("service.fmu.platforms.FOLDER", tmp_path)
    with pytest.raises(FmuLibraryError, match=r"cannot be read .*pip install"):
        library("sparc-solaris.so")
