"""Many requests at once: each begins in its turn, and what else the loop has to do comes in between."""

from __future__ import annotations

import asyncio
import socket
from itertools import pairwise
from typing import Any

from service.api.http.connections.accepting import Acceptor
from service.api.http.connections.turns import Turns


def test_requests_begin_in_order_a_few_in_a_round() -> None:
    async def rounds() -> tuple[list[int], list[int]]:
        turns, begun, seen = Turns(8), list[int](), list[int]()
        for number in range(100):
            turns.take(lambda number=number: begun.append(number))  # type: ignore[misc]
        while len(begun) < 100:
            seen.append(len(begun))
            await asyncio.sleep(0)
        return begun, [*seen, 100]

    begun, seen = asyncio.run(rounds())
    assert begun == list(range(100))
    assert all(after - before <= 8 for before, after in pairwise(seen))


def test_who_comes_when_nobody_waits_begins_at_once() -> None:
    async def one_by_one() -> list[int]:
        turns, begun = Turns(2), list[int]()
        for number in range(5):
            turns.take(lambda number=number: begun.append(number))  # type: ignore[misc]
            assert begun == list(range(number + 1))
            await asyncio.sleep(0)
            await asyncio.sleep(0)
        return begun

    assert asyncio.run(one_by_one()) == list(range(5))


class Echo(asyncio.Protocol):
    def connection_made(self, transport: Any) -> None:
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        self.transport.write(data)


def test_all_who_wait_at_the_door_are_taken_in_and_served() -> None:
    async def served() -> list[bytes]:
        with socket.create_server(("127.0.0.1", 0), backlog=100) as door:
            waiting = [socket.create_connection(door.getsockname()) for _ in range(50)]
            acceptor = Acceptor([door.fileno()], Echo)
            assert acceptor.take(30) == 30
            acceptor.take_last(30)
            assert acceptor.take(30) == 0
            await acceptor.settle()
            loop, answers = asyncio.get_running_loop(), []
            for each in waiting:
                each.setblocking(False)
                await loop.sock_sendall(each, b"hello")
                answers.append(await loop.sock_recv(each, 100))
                each.close()
            await asyncio.sleep(0.1)
            return answers

    assert asyncio.run(served()) == [b"hello"] * 50
