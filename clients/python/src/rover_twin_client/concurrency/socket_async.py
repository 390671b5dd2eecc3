"""A WebSocket that sends one message and waits for one answer; `socket_sync` has the same with threads."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from typing import Any

import httpx
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from rover_twin_client.document import Node
from rover_twin_client.errors import RoverTwinError
from rover_twin_client.live_messages import ANSWER_S, CONNECT_S, LARGEST_BYTES, address, broken, is_answer, packed, read


class AsyncSocket:
    """Opens with the first message and again after it broke."""

    def __init__(self, base_url: httpx.URL, path: str, credentials: dict[str, str]) -> None:
        self._url = address(base_url, path)
        self._credentials = credentials
        self._connection: ClientConnection | None = None
        self._opened = AsyncExitStack()

    @property
    def is_open(self) -> bool:
        """Whether the next message goes over the same connection as the last one."""
        return self._connection is not None

    async def exchange(self, message: dict[str, Any]) -> Node:
        """Sends a message and returns its answer.

        Raises ConnectionFailedError and TimedOutError, after which the connection is closed, and what a refused
        message raises.
        """
        try:
            if self._connection is None:
                opening = connect(
                    self._url, open_timeout=CONNECT_S, max_size=LARGEST_BYTES, compression=None, close_timeout=1,
                    additional_headers=self._credentials,
                )  # fmt: skip
                self._connection = await self._opened.enter_async_context(opening)
            async with asyncio.timeout(ANSWER_S):
                await self._connection.send(packed(message))
                while not is_answer(answer := read(await self._connection.recv())):
                    pass
        except (OSError, WebSocketException) as fault:  # TimeoutError is an OSError
            await self.aclose()
            raise broken(self._url, fault) from fault
        except RoverTwinError:
            raise  # the message was answered
        except BaseException:
            # Cancelled or interrupted while the answer was on its way: the next message must not get that one.
            await self.aclose()
            raise
        return answer

    async def aclose(self) -> None:
        """Closes the connection."""
        self._connection = None
        await self._opened.aclose()
