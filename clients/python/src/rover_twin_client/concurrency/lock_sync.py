"""Whose turn it is among threads; `lock_async` has the same for tasks."""

from threading import Lock

__all__ = ["Lock"]
