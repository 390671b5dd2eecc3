"""Memory that was freed goes back to the system, where the C library is glibc; elsewhere nothing happens here.

glibc gives each thread an arena of its own and keeps what is freed in them. A service that loads and drops versions on
many threads would grow by a seventh over its first forty thousand requests.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -2, -3, -8  # of malloc.h
_ARENAS = 1  # threads seldom allocate at once: nearly all of it happens under the interpreter lock
_OWN_PAGES_BYTES = 8 << 20  # blocks from there on have pages of their own, which go back at once: a batch has none
# What the arena keeps of freed memory, and how much more it asks for than it needs, which costs nothing until it is
# used. Without them a request for a thousand rovers takes 2,000 pages from the system and gives them back: 8 of 30 ms.
_KEPT_BYTES, _AHEAD_BYTES = 32 << 20, 16 << 20
_STATM = Path("/proc/self/statm")
_OBJECTS_BETWEEN_LOOKS = 5_000  # Python's 700 are what a dozen requests make, and nothing of it stays


@contextmanager
def uncollected() -> Iterator[None]:
    """No garbage is looked for meanwhile: of what is imported and put together nothing is, and to look takes time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def settle() -> None:
    """What there is by now stays for good: no collection need look through it while requests wait.

    Not even one now: of 180,000 objects it would find a thousand to drop, in a tenth of a second.
    """
    gc.freeze()
    gc.set_threshold(_OBJECTS_BETWEEN_LOOKS, *gc.get_threshold()[1:])


def limit_arenas() -> None:
    """Let all threads share one arena, and large blocks have none. Call it before there are threads.

    Arrow is told to use it too: a pool of its own keeps what it had once.
    """
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    if (library := _library()) is not None and hasattr(library, "mallopt"):
        library.mallopt(_M_ARENA_MAX, _ARENAS)
        library.mallopt(_M_MMAP_THRESHOLD, _OWN_PAGES_BYTES)
        library.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)
        library.mallopt(_M_TOP_PAD, _AHEAD_BYTES)


class Excess:
    """What was freed and has stayed. glibc gives back the end of its arena only, and one small block there holds all.

    Looked at from time to time: where the process has grown by more than the arena may keep, what is free goes back.
    """

    def __init__(self) -> None:
        self._least_bytes = _resident_bytes()

    def look(self) -> None:
        """Takes microseconds, or milliseconds where there is much to give back."""
        if (now := _resident_bytes()) > self._least_bytes + _KEPT_BYTES:
            give_back()
            self._least_bytes = _resident_bytes()
        else:
            self._least_bytes = min(self._least_bytes, now)


def _resident_bytes() -> int:
    """Memory of this process; 0 where the system does not say it so."""
    try:
        return int(_STATM.read_bytes().split()[1]) * resource.getpagesize()
    except OSError:
        return 0


def give_back() -> None:
    """Hand free memory to the system; takes milliseconds."""
    if pyarrow := sys.modules.get("pyarrow"):  # has a pool of its own
        pyarrow.default_memory_pool().release_unused()
    if (library := _library()) is not None and hasattr(library, "malloc_trim"):
        library.malloc_trim(0)


def _library() -> ctypes.CDLL | None:
    return ctypes.CDLL(None) if sys.platform == "linux" else None
