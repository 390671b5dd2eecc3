"""When refusals are answered: at once while they are few, each in its turn while they are many.

A refusal costs about half a millisecond. A thousand clients that ask again at once leave no time for the work that they
ask for, unless each of them has to wait for its refusal: so they slow themselves down, and a limit of refusals a second
is a limit of what all refusing costs.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

LONGEST_WAIT_S = 4.5  # many clients give up after 5


class Pace:
    """Of one event loop: `per_s` refusals a second, the first half of them at once.

    None waits for longer than `longest_s`: where more wait than have a turn until then, they come faster.
    """

    def __init__(
        self, per_s: float, longest_s: float = LONGEST_WAIT_S, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._step_s = 1 / per_s
        self._slack_s = max(0.5, self._step_s)
        self._longest_s = longest_s
        self._clock = clock
        self._next = 0.0  # when the next one is due if they come evenly

    def wait_s(self) -> float:
        """Seconds that one more refusal has to wait. Counts it."""
        now = self._clock()
        self._next = max(self._next, now - self._slack_s) + self._step_s
        self._next = min(self._next, now + self._longest_s)
        return max(0.0, self._next - now)

    async def turn(self) -> None:
        """Returns when it is time to refuse."""
        wait = self.wait_s()
        if wait > 0:
            await asyncio.sleep(wait)
