"""Where the work of a request is done: on worker threads, so that the event loop always answers.

Predictions and store reads have threads of their own: a store that hangs must not keep loaded models from answering.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import anyio
import anyio.to_thread

from service.errors import RoverTwinError

Result = TypeVar("Result")

RETRY_AFTER_S = 1


class OverloadedError(RoverTwinError):
    """So much work is waiting already that more would only wait in vain."""

    retry_after_s = RETRY_AFTER_S


class WorkerThreads:
    """At most `threads` calls run at once, at most `max_waiting` wait. Make it inside a running event loop."""

    def __init__(self, what: str, threads: int, max_waiting: int) -> None:
        self._what = what
        self._limiter = anyio.CapacityLimiter(threads)
        self._max_waiting = max_waiting

    async def run(self, call: Callable[[], Result], *, give_up_s: float | None = None) -> Result:
        """The call's result, computed on a worker thread; what it raises is raised here.

        Raises OverloadedError when too many wait, and TimeoutError after `give_up_s` (the call then runs on, unseen).
        """
        if self._limiter.available_tokens < 1:
            waiting = self._limiter.statistics().tasks_waiting
            if waiting >= self._max_waiting:
                raise OverloadedError(f"{waiting} {self._what} are waiting already; try again in {RETRY_AFTER_S} s")
        if give_up_s is None:
            return await anyio.to_thread.run_sync(call, limiter=self._limiter)
        with anyio.fail_after(give_up_s):
            return await anyio.to_thread.run_sync(call, limiter=self._limiter, abandon_on_cancel=True)
