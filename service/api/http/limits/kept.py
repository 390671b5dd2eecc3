"""Answers that take seconds and are the same each time: made once, for all who ask meanwhile and later."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from typing import Generic, TypeVar

Value = TypeVar("Value")


class Kept(Generic[Value]):
    """At most `most` values by key, the least recently asked for going first. For one event loop."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: OrderedDict[str, asyncio.Task[Value]] = OrderedDict()

    async def get(self, key: str, make: Callable[[], Awaitable[Value]]) -> Value:
        """The value of a key; made by `make` if there is none yet. What that raises is raised here and not kept.

        A caller that goes away does not stop it: others may wait for the same.
        """
        task = self._values.get(key)
        if task is None:
            task = self._values[key] = asyncio.ensure_future(_awaited(make))
            task.add_done_callback(lambda done: self._forget_failed(key, done))
            while len(self._values) > self._most:
                self._values.popitem(last=False)
        else:
            self._values.move_to_end(key)
        return await asyncio.shield(task)

    def _forget_failed(self, key: str, done: asyncio.Task[Value]) -> None:
        failed = done.cancelled() or done.exception() is not None
        if failed and self._values.get(key) is done:
            del self._values[key]


async def _awaited(make: Callable[[], Awaitable[Value]]) -> Value:
    return await make()
