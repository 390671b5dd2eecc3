"""Only an engine that fits is loaded: each type has the same size on either side, each call the same arguments."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from itertools import chain
from pathlib import Path

import pytest

from service.learning.drive import library as library_module
from service.learning.drive import state
from service.learning.drive.library import MIRRORS, library

NATIVE = Path(library_module.__file__).with_name("native")
HEADER = re.sub(r"/\*.*?\*/", "", (NATIVE / "engine.h").read_text(), flags=re.DOTALL)
COUNTS = dict(re.findall(r"#define (\w+) (\d+)", HEADER))
TYPES = {"double": ctypes.c_double, "int64_t": ctypes.c_int64, **MIRRORS}


def fields(declarations: str) -> list[tuple[str, type]]:
    """Those of a C struct, as ctypes has them."""
    found = []
    for declaration in declarations.replace("const ", "").split(";")[:-1]:
        kind, declarators = declaration.split(maxsplit=1)
        for name, length in re.findall(r"(\*?\w+)(?:\[(\w+)\])?", declarators):
            one = ctypes.c_void_p if name.startswith("*") else TYPES[kind]
            found.append((name.lstrip("*"), one * int(COUNTS.get(length, length)) if length else one))
    return found


def argument(declaration: str) -> type:
    return ctypes.c_void_p if "*" in declaration else TYPES[declaration.split()[0]]


def test_every_struct_has_the_fields_of_its_mirror():
    structs = {name: fields(body) for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", HEADER, re.DOTALL)}
    assert structs == {
        name: mirror._fields_ for name, mirror in MIRRORS.items() if issubclass(mirror, ctypes.Structure)
    }


def test_every_function_has_the_arguments_it_is_called_with():
    prototypes = re.findall(r"^(void|int64_t) (rover_\w+)\(([^)]*)\);", HEADER, re.MULTILINE)
    declared = {
        name: ([argument(each) for each in arguments.split(",") if each != "void"], TYPES.get(answer))
        for answer, name, arguments in prototypes
    }
    pointers = ctypes.c_char_p, ctypes.POINTER(ctypes.c_double)
    called = {
        name: ([ctypes.c_void_p if each in pointers else each for each in arguments], answer)
        for name, (arguments, answer) in library_module._ARGUMENTS.items()
    }
    assert declared == called


def test_a_missing_library_says_what_to_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(library_module, "PATH", tmp_path / "nowhere.so")
    with pytest.raises(ImportError, match=r"nowhere.so cannot be loaded .*pip install"):
        library.__wrapped__()


def test_a_foreign_library_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(library_module, "PATH", Path("libm.so.6"))
    with pytest.raises(ImportError, match=r"another program's .*pip install"):
        library.__wrapped__()


def test_an_outdated_library_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(library_module, "INTERFACE", library_module.INTERFACE + 1)
    with pytest.raises(ImportError, match=r"interface .*pip install"):
        library.__wrapped__()


@pytest.mark.parametrize("name", [*MIRRORS, "rover_unknown"])
def test_a_library_whose_types_have_other_sizes_is_refused(name: str, monkeypatch: pytest.MonkeyPatch):
    there = ctypes.sizeof(MIRRORS.get(name, ctypes.c_double * 0))
    monkeypatch.setitem(MIRRORS, name, ctypes.c_double * 99)
    with pytest.raises(ImportError, match=rf"{name} of .* has {there} bytes, needed are 792: .*pip install"):
        library.__wrapped__()


@pytest.mark.processes
@pytest.mark.parametrize(
    ("before", "after", "refusal"),
    [
        ("", "", None),
        ("double scale[3];", "double scale[4];", "rover_basis of .* 48 bytes, .* 40"),
        ("ROVER_RUT_CELLS 64", "ROVER_RUT_CELLS 32", "rover_state of .* bytes, needed are"),
        ("ROVER_INTERFACE 5", "ROVER_INTERFACE 6", "interface 6, needed is 5"),
        ("rover_sweep", "rover_swap", "another program's .*rover_sweep"),
    ],
)
def test_a_library_of_other_sources_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, after: str, refusal: str | None
):
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("there is no C compiler here")
    for file in chain(NATIVE.glob("*.c"), NATIVE.glob("*.h")):
        text = file.read_text()
        assert file.name != "engine.h" or before in text
        (tmp_path / file.name).write_text(text.replace(before, after) if before else text)
    made = tmp_path / "other.so"
    sources = [str(file) for file in tmp_path.glob("*.c")]
    command = [compiler, "-std=c11", "-fPIC", "-shared", "-o", str(made), *sources, "-lm"]
    subprocess.run(command, check=True, timeout=300)
    monkeypatch.setattr(library_module, "PATH", made)
    if refusal is None:
        library.__wrapped__()
    else:
        with pytest.raises(ImportError, match=refusal):
            library.__wrapped__()


def test_both_sides_agree_on_numbers():
    assert COUNTS["ROVER_RUT_CELLS"] == str(library_module.RUT_CELLS)
    assert COUNTS["ROVER_HEIGHTS"] == str(library_module.HEIGHTS)
    assert library().rover_state_format() == state.FORMAT
    outputs = re.search(r"enum \{ (ROVER_X.*?) \}", HEADER)
    assert outputs is not None
    assert outputs[1].split(", ").index("ROVER_OUTPUTS") == library_module.OUTPUTS
