"""Which processor runs what, and what machine this is."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

_CPUS = sorted(os.sched_getaffinity(0))
SERVER_CPU, CLIENT_CPU = _CPUS[0], _CPUS[-1]
_LIBRARIES = ("numpy", "pyarrow", "orjson", "pydantic", "fastapi", "starlette", "uvicorn", "uvloop", "httptools")


@contextmanager
def running_on(cpu: int) -> Iterator[None]:
    """Whatever this thread does or starts in here runs on one processor."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {cpu})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def described(*, serving: bool = True) -> str:
    """Processor, memory and versions, in Markdown; when `serving`, who had which processor."""
    facts = dict(
        line.split(":", 1) for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if ":" in line
    )
    processor = next((value.strip() for name, value in facts.items() if name.strip() == "model name"), "")
    memory_gib = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30
    count = len(_CPUS)
    where = " (one for the server, another one for the client)" if count > 1 else " (shared by server and client)"
    where = where if serving else ""
    libraries = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    return (
        f"{processor or platform.machine()}, {count} processor{'s' * (count > 1)}{where}, {memory_gib:.0f} GiB, "
        f"{platform.system()} {platform.release().split('-')[0]}. Python {platform.python_version()}, {libraries}."
    )


def load_note(before: tuple[float, float, float]) -> str:
    """How busy the machine was; the benchmark alone makes a load of 1 to 2."""
    return f"Load average of the minute before: {before[0]:.1f}; of the last minute: {os.getloadavg()[0]:.1f}."


def python(module: str, *arguments: str) -> list[str]:
    """The command line of one of our modules."""
    return [sys.executable, "-m", module, *arguments]
