"""Compiles the engine (`service/learning/drive/native`) when the package is built or installed.

The compiler comes from PyPI (`ziglang`, pinned in pyproject.toml): no machine needs its own, and all have the same.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

NATIVE = Path("service/learning/drive/native")
LIBRARY = "librover.so"
GLIBC = (2, 17)  # the oldest that binaries run with; PyTorch's need a newer one
# For any processor of its kind: what gains from newer ones is chosen when it runs, see engine.h. Without
# fused operations all of them round alike.
FLAGS = ["-std=c11", "-O3", "-g0", "-ffp-contract=off", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror"]
X86_FLAGS = ["-mprefer-vector-width=512"]  # where a function is compiled for such vectors


class CompileEngine(BuildHookInterface):
    """An editable install gets the library into the checkout, a wheel gets it straight, a source archive not at all."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatchling before it collects the files."""
        if self.target_name != "wheel":
            return
        target, tag = _platform()
        source = Path(self.root) / NATIVE
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag}"
        if version == "editable":
            self._compile(source, target, source / LIBRARY)
            return
        self._folder = tempfile.TemporaryDirectory()
        library = Path(self._folder.name) / LIBRARY
        self._compile(source, target, library)
        build_data["force_include"][str(library)] = str(NATIVE / LIBRARY)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Called by hatchling when the wheel is written."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()

    def _compile(self, source: Path, target: list[str], library: Path) -> None:
        """Beside, then into its place: processes that run with the old library keep it."""
        with tempfile.TemporaryDirectory(dir=library.parent, prefix=".build-") as folder:
            made = Path(folder) / LIBRARY
            files = [str(file) for file in sorted(source.glob("*.c"))]
            caches = {f"ZIG_{name}_CACHE_DIR": str(Path(folder) / name) for name in ("LOCAL", "GLOBAL")}
            command = [sys.executable, "-m", "ziglang", "cc", *target, *FLAGS, "-o", str(made), *files, "-lm"]
            answer = subprocess.run(command, env={**os.environ, **caches}, capture_output=True, text=True, check=False)  # noqa: S603
            if answer.returncode:
                raise RuntimeError(f"the engine does not compile: {' '.join(command)}\n{answer.stderr}")
            made.replace(library)


def _platform() -> tuple[list[str], str]:
    """What the compiler and the wheel call this platform."""
    if sys.platform == "linux":
        machine, (major, minor) = platform.machine(), GLIBC
        target = ["-target", f"{machine}-linux-gnu.{major}.{minor}", *(X86_FLAGS if machine == "x86_64" else [])]
        return target, f"manylinux_{major}_{minor}_{machine}"
    return [], next(iter(platform_tags()))
