"""Large answers wait for each other: never more at once than there is room for, first come, first served."""

from __future__ import annotations

import asyncio
import random

import pytest

from service.api.http.limits.answer_bytes import WaitingBytes
from service.api.http.limits.worker_threads import OverloadedError


@pytest.mark.parametrize("seed", range(5))
def test_never_more_than_the_limit_but_for_one_that_is_larger(seed: int) -> None:
    async def all_of_them() -> list[int]:
        chance, waiting, order = random.Random(seed), WaitingBytes(100), list[int]()
        running: list[int] = []

        async def one(number: int, size: int) -> None:
            await waiting.reserve(size)
            order.append(number)
            running.append(size)
            assert sum(running) <= waiting.reserved
            assert waiting.reserved <= 100 or len(running) == 1
            await asyncio.sleep(chance.random() / 100)
            running.remove(size)
            waiting.release(size)

        await asyncio.gather(*(one(number, chance.choice([10, 40, 90, 250])) for number in range(30)))
        assert waiting.reserved == 0
        return order

    assert asyncio.run(all_of_them()) == list(range(30))


def test_who_waits_for_too_long_is_refused_and_holds_nothing() -> None:
    async def late() -> None:
        waiting = WaitingBytes(100, longest_wait_s=0.05)
        await waiting.reserve(100)
        with pytest.raises(OverloadedError):
            await waiting.reserve(50)
        gone = asyncio.create_task(waiting.reserve(50))
        await asyncio.sleep(0)
        gone.cancel()
        await asyncio.gather(gone, return_exceptions=True)
        assert waiting.reserved == 100
        waiting.release(100)
        assert waiting.reserved == 0
        await waiting.reserve(100)

    asyncio.run(late())


def test_a_long_line_is_refused_at_once() -> None:
    async def crowd() -> int:
        waiting = WaitingBytes(100)
        await waiting.reserve(100)
        asked = [asyncio.create_task(waiting.reserve(1)) for _ in range(100)]
        await asyncio.sleep(0.05)
        refused = sum(each.done() for each in asked)
        waiting.release(100)
        await asyncio.gather(*asked, return_exceptions=True)
        return refused

    assert asyncio.run(crowd()) == 100 - 32
