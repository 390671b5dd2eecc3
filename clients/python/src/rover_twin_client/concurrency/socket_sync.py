"""A WebSocket that sends one message and waits for one answer; `socket_async` has the same for event loops."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

import httpx
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

from rover_twin_client.document import Node
from rover_twin_client.errors import RoverTwinError
from rover_twin_client.live_messages import ANSWER_S, CONNECT_S, LARGEST_BYTES, address, broken, is_answer, packed, read


class Socket:
    """Opens with the first message and again after it broke."""

    def __init__(self, base_url: httpx.URL, path: str, credentials: dict[str, str]) -> None:
        self._url = address(base_url, path)
        self._credentials = credentials
        self._connection: ClientConnection | None = None
        self._opened = ExitStack()

    @property
    def is_open(self) -> bool:
        """Whether the next message goes over the same connection as the last one."""
        return self._connection is not None

    def exchange(self, message: dict[str, Any]) -> Node:
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
                self._connection = self._opened.enter_context(opening)
            self._connection.send(packed(message))
            while not is_answer(answer := read(self._connection.recv(timeout=ANSWER_S))):
                pass
        except (OSError, WebSocketException) as fault:  # TimeoutError is an OSError
            self.close()
            raise broken(self._url, fault) from fault
        except RoverTwinError:
            raise  # the message was answered
        except BaseException:
            # Cancelled or interrupted while the answer was on its way: the next message must not get that one.
            self.close()
            raise
        return answer

    def close(self) -> None:
        """Closes the connection."""
        self._connection = None
        self._opened.close()
