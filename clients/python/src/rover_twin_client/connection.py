"""What the synchronous client stands on: one pool of connections, one way to send a `Call`, one to follow events."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx
from httpx_sse import EventSource, ServerSentEvent

from rover_twin_client.calls import Answer, Call
from rover_twin_client.following import SILENCE_S, Following, ended_early
from rover_twin_client.network import (
    DEFAULT_RETRIES,
    DEFAULT_TIMEOUT,
    DEFAULT_URL,
    HEADERS,
    checked_actor,
    checked_retries,
    checked_token,
    checked_url,
    named_failures,
    patient,
    request_of,
    retrying,
)
from rover_twin_client.saving import whole_file
from rover_twin_client.training import JobEvent


class Connection:
    """Talks to one rover-twin service. Safe to share between threads; close it, or use it in a `with`.

    `token` is the operator's (`ROVER_TWIN_ADMIN_TOKEN` of the service); only calls that need it send it. `actor` is
    who asks, for the service's records: it names, but proves nothing.

    `timeout` is in seconds for each of connecting, sending and reading (or an httpx.Timeout naming them one by
    one). `retries` is how many further tries a broken connection or a 503 with Retry-After gets. `transport`
    replaces the network, for instance by a proxy or a test's own.
    """

    def __init__(
        self,
        base_url: str = DEFAULT_URL,
        *,
        token: str | None = None,
        actor: str | None = None,
        timeout: float | httpx.Timeout = DEFAULT_TIMEOUT,
        retries: int = DEFAULT_RETRIES,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._url = checked_url(base_url)
        self._retries = checked_retries(retries)
        self._credentials = checked_token(token) | checked_actor(actor)
        self._http = httpx.Client(base_url=self._url, headers=HEADERS, timeout=timeout, transport=transport)

    def close(self) -> None:
        """Closes the connections; the client cannot be used afterwards."""
        self._http.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _answer(self, call: Call[Answer], files: dict[str, Any] | None = None) -> Answer:
        answer: Answer = retrying(self._retries if call.retried else 0)(self._attempt, call, files)
        return answer

    def _attempt(self, call: Call[Answer], files: dict[str, Any] | None) -> Answer:
        with named_failures(self._url):
            response = self._http.send(request_of(self._http, call, files, self._credentials))
        return call.read(response.status_code, response.headers, response.content)

    def _save(self, call: Call[bytes], path: Path) -> Path:
        saved: Path = retrying(self._retries)(self._attempt_to_save, call, path)
        return saved

    def _attempt_to_save(self, call: Call[bytes], path: Path) -> Path:
        with ExitStack() as opened:
            opened.enter_context(named_failures(self._url))
            response = self._http.send(request_of(self._http, call, None, self._credentials), stream=True)
            opened.callback(response.close)
            if response.status_code != httpx.codes.OK:
                call.read(response.status_code, response.headers, response.read())
            take = opened.enter_context(whole_file(path, response.headers))
            for piece in response.iter_bytes():
                take(piece)
        return path

    def _follow(self, path: str, following: Following) -> Iterator[JobEvent]:
        stream = _Stream(self, path, following)
        try:
            while not following.ended:
                event: JobEvent | None = following.again()(stream.next_event)
                if event is not None:
                    yield event
        finally:
            stream.close()

    def _open_stream(self, path: str, following: Following) -> httpx.Response:
        headers = following.headers() | self._credentials
        timeout = patient(self._http.timeout, SILENCE_S)
        response = self._http.send(self._http.build_request("GET", path, headers=headers, timeout=timeout), stream=True)
        try:
            is_stream = response.status_code == httpx.codes.OK
            following.accept(response.status_code, response.headers, b"" if is_stream else response.read())
        except BaseException:
            response.close()
            raise
        return response


class _Stream:
    """The connection that events come over; made again when it broke."""

    def __init__(self, connection: Connection, path: str, following: Following) -> None:
        self._connection = connection
        self._path = path
        self._following = following
        self._response: httpx.Response | None = None
        self._sent: Iterator[ServerSentEvent] = iter(())

    def next_event(self) -> JobEvent | None:
        """The next one, None when there will be none; raises when the connection cannot be made or breaks."""
        try:
            with named_failures(self._connection._url):
                return self._read()
        except BaseException:
            self.close()
            raise

    def _read(self) -> JobEvent | None:
        if self._response is None:
            self._response = self._connection._open_stream(self._path, self._following)
            self._sent = EventSource(self._response).iter_sse()
        if self._following.ended:
            return None
        for sent in self._sent:
            event = self._following.read(sent)
            if event is not None:
                return event
        raise ended_early()

    def close(self) -> None:
        """Let go of the connection."""
        if self._response is not None:
            self._response.close()
            self._response = None
