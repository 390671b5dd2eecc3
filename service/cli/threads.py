"""Processor threads of torch, for commands that compute."""

from __future__ import annotations

import torch

from service.cpu import available_cpus
from service.errors import InvalidValueError

_MOST = 1024


def use_threads(threads: int | None = None) -> None:
    """Use this many threads, else as many as the CPU quota allows. Raises InvalidValueError."""
    if threads is not None and not 1 <= threads <= _MOST:
        raise InvalidValueError("threads", threads, f"1 to {_MOST}")
    torch.set_num_threads(threads or available_cpus())
