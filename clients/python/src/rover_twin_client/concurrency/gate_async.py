"""How many requests of tasks are on their way at once; `gate_sync` has the same for threads."""

from __future__ import annotations

import asyncio


class AsyncGate(asyncio.Semaphore):
    """Lets so many tasks of one event loop through at once."""

    _home: asyncio.AbstractEventLoop | None = None

    def require_home(self) -> None:
        """Raises RuntimeError in another event loop than the first one: the connections live there."""
        here = asyncio.get_running_loop()
        self._home = self._home or here
        if self._home is not here:
            raise RuntimeError(
                "this AsyncRoverTwin was used in another event loop before, and its connections stayed there: "
                "make one inside each asyncio.run, or use one RoverTwin for all threads"
            )


__all__ = ["AsyncGate"]
