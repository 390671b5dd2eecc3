"""How many threads one call of many scenarios may use: 1 unless a process says otherwise.

The caller's thread works too, so a call never waits for a thread that others keep busy. No bit depends on it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress

PART = 64  # scenarios that a thread takes at once: about a millisecond
_MOST = 64

_helpers: ThreadPoolExecutor | None = None
_allowed = 1


def allow_threads(threads: int) -> None:
    """From now on a call may use so many, 64 at most; all calls of the process together one less than that besides."""
    global _helpers, _allowed  # one pool for the process, as torch and BLAS have
    before = _helpers
    _allowed = max(1, min(threads, _MOST))
    _helpers = ThreadPoolExecutor(_allowed - 1, "rover-engine") if _allowed > 1 else None
    if before is not None:
        before.shutdown(wait=False)


def in_parts(work: Callable[[int, int], None], count: int) -> None:
    """Calls `work(first, end)` for parts of `count` that together are all of it. Raises what it raises."""
    parts, pool = -(-count // PART), _helpers
    helpers = min(_allowed, parts) - 1
    if helpers < 1 or pool is None:
        work(0, count)
        return
    numbers = itertools.count()  # whose next() is one step of the interpreter: no part is taken twice

    def some() -> None:
        while (part := next(numbers)) < parts:
            work(part * PART, min((part + 1) * PART, count))

    others: list[Future[None]] = []
    with suppress(RuntimeError):  # the pool is being closed: then this thread does all
        others += [pool.submit(some) for _ in range(helpers)]
    try:
        some()
    finally:
        for other in others:
            other.cancel()  # those that found no thread
        wait([other for other in others if not other.cancelled()])
    for other in others:
        if not other.cancelled():
            other.result()
