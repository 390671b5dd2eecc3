"""Takes in all who wait at the door, not one at a time.

uvloop's library (libuv since 1.45) takes one connection in each round of the event loop, and a round lasts as long as
all requests that are there: with 256 busy clients a newcomer waited for seconds behind others that waited as it did.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Callable, Iterable
from contextlib import suppress

AT_ONCE = 64  # in one round: several processes that listen on one socket shall get some each


class Acceptor:
    """Beside the server of an event loop: `take` connections of its listening sockets when the server took one.

    `protocol` makes what serves a connection.
    """

    def __init__(self, listeners: Iterable[int], protocol: Callable[[], asyncio.Protocol]) -> None:
        self._protocol = protocol
        self._tasks: set[asyncio.Task[object]] = set()
        # sockets of its own for the same doors: the server's must not be touched behind its back
        self._listeners = [socket.socket(fileno=os.dup(each)) for each in listeners]
        for each in self._listeners:
            each.setblocking(False)

    def take(self, most: int = AT_ONCE) -> int:
        """Takes in who waits, at most so many at each door; how many there were."""
        return sum(self._take_at(each, most) for each in self._listeners)

    def take_last(self, most: int) -> None:
        """Takes in who waits, at most so many at each door; no more are taken then.

        Meanwhile the system lets in nobody else, whom the close would reset: it drops their first packet. They send it
        again after a second, and are refused then, or find another server.
        """
        for each in self._listeners:
            each.listen(0)
        self.take(most)
        for each in self._listeners:
            each.close()
        self._listeners = []

    async def settle(self) -> None:
        """Returns when all that were taken are served."""
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _take_at(self, listener: socket.socket, most: int) -> int:
        for count in range(most):
            try:
                connection, _ = listener.accept()
            except OSError:  # nobody waits, or there are no files left: the server deals with that
                return count
            connection.setblocking(False)
            task = asyncio.get_running_loop().create_task(self._serve(connection))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        return most

    async def _serve(self, connection: socket.socket) -> None:
        with suppress(OSError):  # gone already
            await asyncio.get_running_loop().connect_accepted_socket(self._protocol, connection)
