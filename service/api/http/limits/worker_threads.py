"""Where the work of a request is done: on worker threads, so that the event loop always answers.

Predictions and store reads have threads of their own: a store that hangs must not keep loaded models from answering.
"""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import anyio
import anyio.to_thread
from starlette.requests import Request

from service.api.http.limits.pace import Pace
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


class _GaveUpError(TimeoutError):
    """Not the call's own: it is still running, or waits for its thread."""


class WorkerThreads:
    """At most `threads` calls run at once, at most `max_waiting` wait. Make it inside a running event loop.

    `admit` is called on the thread before each call; what it raises is raised instead. `pace` says when a call too
    many is refused; without it, at once. `patience` says for how long a call is waited for that names no time of its
    own, and what is raised then; without it, until it is done.
    """

    def __init__(
        self,
        what: str,
        threads: int,
        max_waiting: int,
        admit: Callable[[], None] = lambda: None,
        pace: Pace | None = None,
        patience: Callable[[], tuple[float, Exception]] | None = None,
    ) -> None:
        self._what = what
        self._max_waiting = max_waiting
        self._admit = admit
        self._pace = pace
        self._patience = patience
        self._limiter = anyio.CapacityLimiter(threads)

    async def run(
        self, call: Callable[[], Result], *, give_up_s: float | None = None, asker: Request | None = None
    ) -> Result:
        """The call's result, computed on a worker thread; what it raises is raised here.

        With the request of the `asker`, nothing is computed for one that went away while it waited: ClientGoneError.
        Raises OverloadedError when too many wait; TimeoutError `give_up_s` seconds after the question, however they
        were spent, or what `patience` says. A call that was given up runs on, unseen, and keeps its thread: calls that
        hang never take more than all of these.
        """
        gave_up: Exception = _GaveUpError()
        if give_up_s is None and self._patience is not None:
            give_up_s, gave_up = self._patience()
        until = math.inf if give_up_s is None else anyio.current_time() + give_up_s
        await self._require_room()

        def admitted() -> Result:
            self._admit()
            return call()

        waits = self._limiter.available_tokens < 1
        if until == math.inf and not (waits and asker):
            return await anyio.to_thread.run_sync(admitted, limiter=self._limiter)
        try:
            return await self._run(admitted, until, asker if waits else None)
        except _GaveUpError:
            raise gave_up from None

    async def _require_room(self) -> None:
        """Raises OverloadedError, when its turn has come, if there is no room then either."""
        if self._is_full() and self._pace is not None:
            await self._pace.turn()
        if self._is_full():
            waiting = f"{self._max_waiting} {self._what}"
            raise OverloadedError(f"{waiting} are waiting already; try again in {RETRY_AFTER_S} s")

    async def _run(self, call: Callable[[], Result], until: float, asker: Request | None) -> Result:
        """Raises _GaveUpError at the time `until` of the event loop, and ClientGoneError."""
        place, loop = object(), asyncio.get_running_loop()
        begun = threading.Lock()  # taken by the thread when it begins, or by who gives up before it has

        def held() -> Result:
            if not begun.acquire(blocking=False):
                raise _GaveUpError
            try:
                return call()
            finally:
                with suppress(RuntimeError):  # the loop has ended
                    loop.call_soon_threadsafe(self._limiter.release_on_behalf_of, place)

        with anyio.CancelScope(deadline=until):
            await self._limiter.acquire_on_behalf_of(place)
            try:
                if asker is not None and await asker.is_disconnected():
                    raise ClientGoneError
                own, bounded = anyio.CapacityLimiter(1), until < math.inf
                return await anyio.to_thread.run_sync(held, limiter=own, abandon_on_cancel=bounded)
            finally:
                if begun.acquire(blocking=False):
                    self._limiter.release_on_behalf_of(place)
        raise _GaveUpError

    def _is_full(self) -> bool:
        return self._limiter.available_tokens < 1 and self._limiter.statistics().tasks_waiting >= self._max_waiting
