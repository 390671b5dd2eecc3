"""Where the work of a request is done: on worker threads, so that the event loop always answers.

Predictions and store reads have threads of their own: a store that hangs must not keep loaded models from answering.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import anyio
import anyio.to_thread
from starlette.requests import Request

from service.api.http.pace import Pace
from service.errors import RoverTwinError

Result = TypeVar("Result")

RETRY_AFTER_S = 1


class OverloadedError(RoverTwinError):
    """So much work is waiting already that more would only wait in vain."""

    retry_after_s = RETRY_AFTER_S


class ClientGoneError(RoverTwinError):
    """The client hung up while its request waited: there is nobody to answer."""

    def __init__(self) -> None:
        super().__init__("the client hung up")


class WorkerThreads:
    """At most `threads` calls run at once, at most `max_waiting` wait. Make it inside a running event loop.

    `admit` is called before each call that has waited for its thread; what it raises is raised instead. `pace` says
    when a call too many is refused; without it, at once.
    """

    def __init__(
        self,
        what: str,
        threads: int,
        max_waiting: int,
        admit: Callable[[], None] = lambda: None,
        pace: Pace | None = None,
    ) -> None:
        self._what = what
        self._pace = pace
        self._admit = admit
        self._limiter = anyio.CapacityLimiter(threads)
        self._max_waiting = max_waiting

    async def run(
        self, call: Callable[[], Result], *, give_up_s: float | None = None, asker: Request | None = None
    ) -> Result:
        """The call's result, computed on a worker thread; what it raises is raised here.

        With the request of the `asker`, nothing is computed for one that went away while it waited. Raises
        OverloadedError when too many wait, TimeoutError after `give_up_s` (the call then runs on, unseen), and
        ClientGoneError.
        """
        if self._is_full():
            if self._pace is not None:
                await self._pace.turn()
            if self._is_full():  # else there is room by now
                waiting = f"{self._max_waiting} {self._what}"
                raise OverloadedError(f"{waiting} are waiting already; try again in {RETRY_AFTER_S} s")

        def admitted() -> Result:
            self._admit()
            return call()

        if asker is not None and self._limiter.available_tokens < 1:
            async with self._limiter:
                if await asker.is_disconnected():
                    raise ClientGoneError
                return await anyio.to_thread.run_sync(admitted, limiter=anyio.CapacityLimiter(1))
        if give_up_s is None:
            return await anyio.to_thread.run_sync(admitted, limiter=self._limiter)
        with anyio.fail_after(give_up_s):
            return await anyio.to_thread.run_sync(admitted, limiter=self._limiter, abandon_on_cancel=True)

    def _is_full(self) -> bool:
        return self._limiter.available_tokens < 1 and self._limiter.statistics().tasks_waiting >= self._max_waiting
