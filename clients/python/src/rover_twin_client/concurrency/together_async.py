"""Lets a few tasks work beside each other; `together_sync` has the same for threads."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable


async def together(work: Callable[[], Awaitable[None]], times: int, give_up: Callable[[], None]) -> None:
    """Runs `work` so many times at once, and raises the first failure.

    After a failure or a cancellation it calls `give_up`, and no task is left.
    """
    try:
        async with asyncio.TaskGroup() as group:
            for _ in range(times):
                group.create_task(_awaited(work))
    except BaseExceptionGroup as failures:
        raise failures.exceptions[0] from None
    finally:
        give_up()


async def _awaited(work: Callable[[], Awaitable[None]]) -> None:
    await work()
