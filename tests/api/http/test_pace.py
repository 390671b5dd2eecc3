"""Refusals: at once while they are few, in turn while they are many, and nobody waits for longer than was said."""

from __future__ import annotations

import random

import pytest

from service.api.http.limits.pace import Pace


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize("per_s", [1, 40, 200])
def test_a_few_are_refused_at_once(per_s: int) -> None:
    clock = Clock()
    pace = Pace(per_s, clock=clock)
    for _ in range(20):
        clock.now += 1.01 / per_s
        assert pace.wait_s() == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_no_more_than_so_many_a_second_leave(seed: int) -> None:
    clock, chance = Clock(), random.Random(seed)
    pace = Pace(50, longest_s=1000, clock=clock)
    left = []
    for _ in range(2000):
        clock.now += chance.choice([0.0, 0.001, 0.01, 0.3])
        left.append(clock.now + pace.wait_s())
    left.sort()
    for first in range(0, len(left), 37):
        within = sum(left[first] <= each < left[first] + 2 for each in left)
        assert within <= 50 * 2.5 + 1


def test_nobody_waits_for_longer_than_was_said() -> None:
    pace = Pace(10, longest_s=3, clock=Clock())
    waits = [pace.wait_s() for _ in range(1000)]
    assert waits == sorted(waits)
    assert max(waits) <= 3
