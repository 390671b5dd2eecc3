"""Worker threads: what waits is bounded in number and in time, and nothing is computed for those who went away."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import pytest

from service.api.http.limits.pace import Pace
from service.api.http.limits.worker_threads import ClientGoneError, OverloadedError, WorkerThreads

LONG_S = 30.0


class StoreHangsError(Exception):
    """What the line under test is told to raise."""


class Asker:
    """A request of which only one thing is asked."""

    def __init__(self, *, gone: bool) -> None:
        self.gone = gone

    async def is_disconnected(self) -> bool:
        return self.gone


class Stuck:
    """A call that takes until it is let go."""

    def __init__(self) -> None:
        self.go = threading.Event()
        self.begun = 0

    def __call__(self) -> str:
        self.begun += 1
        assert self.go.wait(LONG_S)
        return "done"


class LongTurn(Pace):
    """Whose turns come when it is said."""

    def __init__(self) -> None:
        super().__init__(1)
        self.over = asyncio.Event()

    async def turn(self) -> None:
        await self.over.wait()


def patience(seconds: float) -> Callable[[], tuple[float, Exception]]:
    return lambda: (seconds, StoreHangsError())


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(LONG_S):
        while not condition():
            await asyncio.sleep(0.005)


def in_a_loop(work: Callable[[Stuck], Any]) -> Any:
    """Runs `work` with a stuck call that is let go at the end, whatever happens."""
    stuck = Stuck()

    async def whole() -> Any:
        try:
            return await work(stuck)
        finally:
            stuck.go.set()

    return asyncio.run(whole())


async def busy(threads: WorkerThreads, stuck: Stuck, waiting: int = 0, give_up_s: float | None = LONG_S) -> list[Any]:
    """One call that runs, and so many that wait behind it."""
    running = [asyncio.create_task(threads.run(stuck, give_up_s=give_up_s))]
    await until(lambda: stuck.begun == 1)
    running += [asyncio.create_task(threads.run(stuck, give_up_s=give_up_s)) for _ in range(waiting)]
    await until(lambda: threads._limiter.statistics().tasks_waiting == waiting)
    return running


@pytest.mark.parametrize("give_up_s", [None, LONG_S])
@pytest.mark.parametrize("pace", [None, Pace(50)])
def test_a_result_and_an_error_come_back_and_a_call_too_many_is_refused(
    give_up_s: float | None, pace: Pace | None
) -> None:
    async def work(stuck: Stuck) -> list[str]:
        threads = WorkerThreads("calls", 1, 2, pace=pace)
        assert await threads.run(lambda: 7, give_up_s=give_up_s) == 7
        with pytest.raises(ZeroDivisionError):
            await threads.run(lambda: 1 // 0, give_up_s=give_up_s)
        running = await busy(threads, stuck, waiting=2, give_up_s=give_up_s)
        with pytest.raises(OverloadedError, match="2 calls are waiting"):
            await threads.run(lambda: 7, give_up_s=give_up_s)
        stuck.go.set()
        return list(await asyncio.gather(*running))

    assert in_a_loop(work) == ["done"] * 3


def test_who_is_refused_waits_for_its_turn_and_is_served_if_there_is_room_by_then() -> None:
    async def work(stuck: Stuck) -> int:
        pace = Pace(1)
        pace.wait_s()
        threads = WorkerThreads("calls", 1, 0, pace=pace)
        (running,) = await busy(threads, stuck)
        late = asyncio.create_task(threads.run(lambda: 7))
        await asyncio.sleep(0.05)
        assert not late.done()
        stuck.go.set()
        await running
        return await late

    assert in_a_loop(work) == 7


@pytest.mark.parametrize("waiting", [0, 1])
@pytest.mark.parametrize("asker", [None, Asker(gone=False)])
def test_a_call_is_given_up_in_the_words_of_the_line_whether_it_runs_or_waits(waiting: int, asker: Any) -> None:
    async def work(stuck: Stuck) -> None:
        threads = WorkerThreads("calls", 1, 9, patience=patience(0.1))
        running = await busy(threads, stuck) if waiting else []
        with pytest.raises(StoreHangsError):
            await threads.run(stuck, asker=asker)
        assert stuck.begun <= 1  # one that only waited never begins
        stuck.go.set()
        assert await asyncio.gather(*running) == ["done"] * waiting
        await until(lambda: threads._limiter.available_tokens == 1)
        assert await threads.run(lambda: 7) == 7

    in_a_loop(work)


def test_a_time_of_its_own_comes_before_the_patience_of_the_line() -> None:
    async def work(stuck: Stuck) -> None:
        threads = WorkerThreads("calls", 1, 9, patience=patience(LONG_S))
        with pytest.raises(TimeoutError):
            await threads.run(stuck, give_up_s=0.05)

    in_a_loop(work)


def test_a_timeout_of_the_call_itself_is_its_own() -> None:
    def fails() -> None:
        raise TimeoutError("of a socket")

    async def work(_stuck: Stuck) -> None:
        threads = WorkerThreads("calls", 1, 9, patience=patience(LONG_S))
        with pytest.raises(TimeoutError, match="of a socket"):
            await threads.run(fails)

    in_a_loop(work)


def test_the_wait_for_a_turn_is_part_of_the_patience() -> None:
    """Else who meets a hanging store would wait for both, one after the other."""

    async def work(stuck: Stuck) -> None:
        pace = LongTurn()
        threads = WorkerThreads("calls", 1, 1, pace=pace, patience=patience(0.1))
        _, waiting = await busy(threads, stuck, waiting=1)
        late = asyncio.create_task(threads.run(stuck))
        await asyncio.sleep(0.2)
        waiting.cancel()  # somebody goes away: there is room by then
        await until(waiting.done)
        pace.over.set()
        for _ in range(10):  # rounds of the loop, no time
            await asyncio.sleep(0)
        assert isinstance(late.exception(), StoreHangsError)

    in_a_loop(work)


@pytest.mark.parametrize("line", [{}, {"patience": patience(LONG_S)}])
@pytest.mark.parametrize("gone", [True, False])
def test_nothing_is_computed_for_who_went_away_while_it_waited(line: dict[str, Any], gone: bool) -> None:
    async def work(stuck: Stuck) -> list[int]:
        threads, computed = WorkerThreads("calls", 1, 9, **line), list[int]()
        (running,) = await busy(threads, stuck)
        asker: Any = Asker(gone=gone)
        late = asyncio.create_task(threads.run(lambda: computed.append(7), asker=asker))
        await until(lambda: threads._limiter.statistics().tasks_waiting == 1)
        stuck.go.set()
        await running
        if gone:
            with pytest.raises(ClientGoneError):
                await late
        else:
            await late
        await until(lambda: threads._limiter.available_tokens == 1)
        return computed

    assert in_a_loop(work) == [] if gone else [7]


def test_what_admission_raises_is_raised_instead_of_the_call() -> None:
    def refuse() -> None:
        raise StoreHangsError

    async def work(stuck: Stuck) -> None:
        threads = WorkerThreads("calls", 1, 9, refuse, patience=patience(LONG_S))
        with pytest.raises(StoreHangsError):
            await threads.run(stuck)
        assert stuck.begun == 0

    in_a_loop(work)
