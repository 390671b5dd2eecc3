"""Requests begin a few at a time, so that a round of the event loop stays short however many clients ask at once.

In one round the loop reads from all connections that have sent something, then does all that is to be done. With 256
busy clients that took a tenth of a second and more, in which nobody was let in, no result of a thread was sent, and no
probe was answered. In turns each request waits as long as before, and everything else does not.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

EACH_ROUND = 8


class Turns:
    """The line of one event loop, first come, first served."""

    def __init__(self, each_round: int = EACH_ROUND) -> None:
        self._each_round = each_round
        self._line: deque[Callable[[], object]] = deque()
        self._begun = 0  # in this round
        self._awaits_round = False

    def __len__(self) -> int:
        return len(self._line)

    def take(self, begin: Callable[[], object]) -> None:
        """Calls `begin` now if few have begun in this round of the loop, else in its turn."""
        if not self._line and self._begun < self._each_round:
            self._begun += 1
            begin()
        else:
            self._line.append(begin)
        if not self._awaits_round:
            self._awaits_round = True
            asyncio.get_running_loop().call_soon(self._round)

    def _round(self) -> None:
        self._begun = min(self._each_round, len(self._line))
        for _ in range(self._begun):
            self._line.popleft()()
        self._awaits_round = self._begun > 0
        if self._awaits_round:
            asyncio.get_running_loop().call_soon(self._round)
