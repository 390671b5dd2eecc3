"""Whose turn it is among tasks; `lock_sync` has the same for threads."""

from asyncio import Lock as AsyncLock

__all__ = ["AsyncLock"]
