"""Compiles the engine (`service/learning/drive/native`) and, with it inside, the libraries of exported FMUs
(`service/fmu/native`), and the writer of numbers (`service/wire/native`), when the package is built or installed.

The compiler comes from PyPI (`ziglang`, pinned in pyproject.toml): no machine needs its own, and all have the same. It
compiles for other machines too, so that an FMU runs on them.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import ziglang
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

ENGINE, FMU = Path("service/learning/drive/native"), Path("service/fmu/native")
MANY = ENGINE / "lanes.c"  # drives many rovers at once, of which an FMU has one
DIGITS = Path("service/wire/native")
GLIBC = (2, 17)  # the oldest that binaries run with; PyTorch's need a newer one
# For any processor of its kind: what gains from newer ones is chosen when it runs, see engine.h. Without
# fused operations all of them round alike.
FLAGS = ["-std=c11", "-O3", "-g0", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]
X86_FLAGS = ["-mprefer-vector-width=512"]  # where a function is compiled for such vectors
LINK = ["-dynamic", "-O", "ReleaseFast", "-fstrip", "-fno-ubsan-rt"]
# With the system's C library. What compilers bring along for processors that lack operations takes as long to make as
# everything else, and these lack none.
SYSTEM = ["-lc", "-fno-compiler-rt", "-fno-soname"]
# Without one: it would take minutes to make, and the little that is needed is in system.c and comes with the compiler.
WINDOWS = ["-fcompiler-rt", "-fentry=DllMainCRTStartup", "-fno-emit-implib"]
HEADERS = Path(ziglang.__file__).parent / "lib/libc/include/any-windows-any"


class Library(NamedTuple):
    """One library to be made: its file, where its sources are, what the compiler calls its platform ("": this one)."""

    file: Path
    sources: tuple[Path, ...]
    target: str

    def command(self, root: Path, folder: Path, made: Path) -> list[str]:
        """How to compile it into `made`; `folder` is for what is needed on the way."""
        target, flags, rest = ["-target", self.target] if self.target else [], list(FLAGS), SYSTEM
        if self.target.startswith("x86_64"):
            flags += X86_FLAGS
        if self.file.parent == FMU and "windows" not in self.target:
            flags += ["-fvisibility=hidden"]
        files = [str(file) for source in self.sources for file in sorted((root / source).glob("*.c"))]
        if self.file.parent == FMU:
            files.remove(str(root / MANY))
        if "windows" in self.target:
            system = folder / "kernel32.lib"
            _zig(folder, "dlltool", "-m", "i386:x86-64", "-d", str(root / FMU / "kernel32.def"), "-l", str(system))
            flags += ["-isystem", str(HEADERS)]
            files, rest = [*files, str(system)], WINDOWS
        elif platform.machine() not in ("x86_64", "aarch64", "arm64"):
            rest = ["-lc"]
        include = ["-I", str(root / ENGINE)]
        return ["build-lib", *target, *LINK, *rest, *include, f"-femit-bin={made}", "-cflags", *flags, "--", *files]


LIBRARIES = tuple(
    Library(FMU / file, (ENGINE, FMU), target)
    for file, target in {
        "x86_64-windows.dll": "x86_64-windows-gnu",  # takes longest
        "x86_64-linux.so": "x86_64-linux-gnu.{}.{}".format(*GLIBC),
        "aarch64-linux.so": "aarch64-linux-gnu.{}.{}".format(*GLIBC),
        "x86_64-darwin.dylib": "x86_64-macos.11.0",
        "aarch64-darwin.dylib": "aarch64-macos.11.0",
    }.items()
)


class CompileEngine(BuildHookInterface):
    """An editable install gets the libraries into the checkout, a wheel gets them straight, a source archive none."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it collects the files."""
        if self.target_name != "wheel":
            return
        target, tag = _platform()
        root = Path(self.root)
        engine, digits = ENGINE / "librover.so", DIGITS / "libdigits.so"
        libraries = (Library(engine, (ENGINE,), target), Library(digits, (DIGITS,), target), *LIBRARIES)
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag}"
        if version == "editable":
            compile_all(root, libraries, root)
            return
        self._folder = tempfile.TemporaryDirectory()
        made = Path(self._folder.name)
        for library in libraries:
            (made / library.file.parent).mkdir(parents=True, exist_ok=True)
            build_data["force_include"][str(made / library.file)] = str(library.file)
        compile_all(root, libraries, made)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Called by hatchling when the wheel is written."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()


def compile_all(root: Path, libraries: tuple[Library, ...], to: Path) -> None:
    """Several at once, each beside, then into its place: processes that run with the old one keep it."""
    with tempfile.TemporaryDirectory(dir=to, prefix=".build-") as folder, ThreadPoolExecutor(os.cpu_count()) as threads:

        def compiled(library: Library) -> None:
            made = Path(folder) / library.file.name
            _zig(Path(folder), *library.command(root, Path(folder), made))
            made.replace(to / library.file)

        for _ in threads.map(compiled, libraries):
            pass  # or what went wrong is not told


def _zig(folder: Path, *arguments: str) -> None:
    caches = {f"ZIG_{name}_CACHE_DIR": str(folder / name) for name in ("LOCAL", "GLOBAL")}
    command = [sys.executable, "-m", "ziglang", *arguments]
    answer = subprocess.run(command, env={**os.environ, **caches}, capture_output=True, text=True, check=False)  # noqa: S603
    if answer.returncode:
        raise RuntimeError(f"the engine does not compile: {' '.join(command)}\n{answer.stderr}")


def _platform() -> tuple[str, str]:
    """What the compiler and the wheel call this platform."""
    if sys.platform == "linux":
        machine, (major, minor) = platform.machine(), GLIBC
        return f"{machine}-linux-gnu.{major}.{minor}", f"manylinux_{major}_{minor}_{machine}"
    return "", next(iter(platform_tags()))
