"""Lets a few threads work beside each other; `together_async` has the same for tasks."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor


def together(work: Callable[[], None], times: int, give_up: Callable[[], None]) -> None:
    """Runs `work` so many times at once, and raises the first failure.

    After a failure, or a Ctrl-C, it calls `give_up` and waits for what is on its way. No thread is left.
    """
    with ThreadPoolExecutor(times, thread_name_prefix="rover-twin") as pool:
        try:
            for each in [pool.submit(work) for _ in range(times)]:
                each.result()
        finally:
            give_up()
