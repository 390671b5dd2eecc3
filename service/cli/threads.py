"""Processor threads, for commands that compute."""

from __future__ import annotations

from service.cpu import available_cpus, limit_compute_threads
from service.errors import InvalidValueError

_MOST = 1024


def use_threads(threads: int | None = None) -> None:
    """Use this many threads, else as many as the CPU quota allows. Raises InvalidValueError."""
    if threads is not None and not 1 <= threads <= _MOST:
        raise InvalidValueError("threads", threads, f"1 to {_MOST}")
    limit_compute_threads(threads or available_cpus())
