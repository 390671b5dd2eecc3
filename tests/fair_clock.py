"""Seconds that count only while this machine really runs: for bounds that a stall of a shared machine must not break.

A machine that others use may stand still for seconds, for the test and for what it tests alike. A thread that sleeps a
hundredth of a second at a time notices: however long such a sleep took, it counts as two hundredths at most. What
blocks only the code under test is counted in full, so that a bound on fair seconds keeps its teeth.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

TICK_S = 0.01
_LONGEST_TICK_S = 2 * TICK_S


class FairClock:
    """Call it for the fair seconds since it was started; it never runs ahead of the wall clock."""

    def __init__(self) -> None:
        self._seconds = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fair clock", daemon=True)

    def __call__(self) -> float:
        return self._seconds

    def wait_until(self, condition: object, within_s: float, what: str = "") -> None:
        """Look every twentieth of a second; fails when `within_s` fair seconds were not enough."""
        assert callable(condition)
        end = self() + within_s
        while not condition():
            assert self() < end, f"not within {within_s} fair seconds: {what or condition}"
            time.sleep(0.05)

    def start(self) -> None:
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        before = time.monotonic()
        while not self._ended.wait(TICK_S):
            now = time.monotonic()
            self._seconds += min(now - before, _LONGEST_TICK_S)
            before = now


@contextmanager
def fair_clock() -> Iterator[FairClock]:
    """A clock that runs until the block ends."""
    clock = FairClock()
    clock.start()
    try:
        yield clock
    finally:
        clock.end()
