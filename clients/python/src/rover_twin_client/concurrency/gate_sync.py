"""How many requests of threads are on their way at once; `gate_async` has the same for tasks."""

from __future__ import annotations

import threading


class Gate(threading.BoundedSemaphore):
    """Lets so many threads through at once."""

    def require_home(self) -> None:
        """Every thread will do."""


__all__ = ["Gate"]
