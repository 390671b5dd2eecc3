"""How many requests of threads are on their way at once; `gate_async` has the same for tasks."""

from threading import BoundedSemaphore as Gate

__all__ = ["Gate"]
