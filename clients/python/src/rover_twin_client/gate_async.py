"""How many requests of tasks are on their way at once; `gate_sync` has the same for threads."""

from asyncio import Semaphore as AsyncGate

__all__ = ["AsyncGate"]
