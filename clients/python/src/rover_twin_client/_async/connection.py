"""The base of the client: a pool of connections that sends a `Call` and follows the events of a job."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx
from httpx_sse import EventSource, ServerSentEvent
from tenacity import AsyncRetrying

from rover_twin_client.address import checked_url
from rover_twin_client.calls import Answer, Call, form_of, in_form
from rover_twin_client.concurrency.gate_async import AsyncGate
from rover_twin_client.following import SILENCE_S, Following, ended_early
from rover_twin_client.network import (
    DEFAULT_CONNECTIONS,
    DEFAULT_RETRIES,
    DEFAULT_TIMEOUT,
    DEFAULT_URL,
    HEADERS,
    UNLIMITED,
    checked_connections,
    checked_retries,
    checked_token,
    from_sending,
    limits_of,
    named_failures,
    patient,
    request_of,
    retrying,
)
from rover_twin_client.saving import whole_file
from rover_twin_client.training import JobEvent


class AsyncConnection:
    """Connects to one rover-twin service. Use it from one event loop. Close it, or use it in `async with`.

    `token` is one that the operator of the service gave you; every call sends it. Datasets, training jobs and aliases
    need it, all else where the service was started so. Its name is the `actor` in the service's records.

    `base_url` is the address of the service, with or without `/v1` at its end.

    `timeout` limits connecting, sending and reading, in seconds each (up to a day); an `httpx.Timeout` sets them one by
    one. One that is given holds for batches and drives too, which wait longer for their answers otherwise; an upload,
    the events of a job and a live step always have waits of their own.
    `connections` (1 to 256) is how many requests are on their way at once. Further ones wait for their turn, as long
    as it takes: that is no time-out, because the clock of a request starts when it is sent.
    `retries` (0 to 10) is how many more times a call is tried, when the connection breaks or the service answers 503
    with a Retry-After of at most 10 s. `transport` replaces the network, for example with a proxy or in a test.

    Raises ValueError for an argument that cannot be used. A call raises RuntimeError once the client is closed.
    """

    def __init__(
        self,
        base_url: str = DEFAULT_URL,
        *,
        token: str | None = None,
        timeout: float | httpx.Timeout = DEFAULT_TIMEOUT,
        retries: int = DEFAULT_RETRIES,
        connections: int = DEFAULT_CONNECTIONS,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        self._url = checked_url(base_url)
        self._retries = checked_retries(retries)
        self._credentials = checked_token(token)
        self._gate = AsyncGate(checked_connections(connections))
        self._has_default_timeout = timeout is DEFAULT_TIMEOUT
        self._http = httpx.AsyncClient(
            base_url=self._url, headers=HEADERS, timeout=from_sending(timeout), limits=UNLIMITED, transport=transport
        )

    async def aclose(self) -> None:
        """Closes the connections; the client cannot be used afterwards."""
        await self._http.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.aclose()

    async def _answer(self, call: Call[Answer], files: dict[str, Any] | None = None) -> Answer:
        retries = self._retries if call.retried else 0
        answer: Answer = await retrying(AsyncRetrying, retries)(self._attempt, call, files)
        return answer

    async def _attempt(self, call: Call[Answer], files: dict[str, Any] | None) -> Answer:
        self._require_usable()
        async with self._gate:
            response = await self._sent(call, files)
        return call.read(response.status_code, response.headers, response.content)

    async def _sent(self, call: Call[Answer], files: dict[str, Any] | None) -> httpx.Response:
        with named_failures(self._url):
            return await self._http.send(self._request(call, files))

    def _request(self, call: Call[Any], files: dict[str, Any] | None) -> httpx.Request:
        self._require_usable()
        timeout = limits_of(call, self._http.timeout, is_default=self._has_default_timeout)
        return request_of(self._http, call, files, self._credentials, timeout)

    def _require_usable(self) -> None:
        if self._http.is_closed:
            raise RuntimeError("this client was closed: make another one")
        self._gate.require_home()

    async def _answer_as(
        self, call: Call[Answer], form: str | None, save_to: str | os.PathLike[str] | None
    ) -> Answer | bytes | Path:
        """The value of the answer; with `form` its bytes, with `save_to` the path of a file that holds them."""
        form = form_of(form, save_to)
        if form is None:
            return await self._answer(call)
        if save_to is None:
            return await self._answer(in_form(call, form))
        return await self._save(in_form(call, form), Path(save_to))

    async def _save(self, call: Call[bytes], path: Path) -> Path:
        saved: Path = await retrying(AsyncRetrying, self._retries)(self._attempt_to_save, call, path)
        return saved

    async def _attempt_to_save(self, call: Call[bytes], path: Path) -> Path:
        self._require_usable()
        async with self._gate, AsyncExitStack() as opened:
            opened.enter_context(named_failures(self._url))
            response = await self._http.send(self._request(call, None), stream=True)
            opened.push_async_callback(response.aclose)
            if response.status_code != httpx.codes.OK:
                call.read(response.status_code, response.headers, await response.aread())
            take = opened.enter_context(whole_file(path, response.headers))
            async for piece in response.aiter_bytes():
                take(piece)
        return path

    async def _follow(self, path: str, following: Following) -> AsyncIterator[JobEvent]:
        stream = _Stream(self, path, following)
        try:
            while not following.ended:
                event: JobEvent | None = await following.again(AsyncRetrying)(stream.next_event)
                if event is not None:
                    yield event
        finally:
            await stream.aclose()

    async def _open_stream(self, path: str, following: Following) -> httpx.Response:
        self._require_usable()
        headers = following.headers() | self._credentials
        timeout = patient(self._http.timeout, SILENCE_S)
        request = self._http.build_request("GET", path, headers=headers, timeout=timeout)
        response = await self._http.send(request, stream=True)
        try:
            is_stream = response.status_code == httpx.codes.OK
            following.accept(response.status_code, response.headers, b"" if is_stream else await response.aread())
        except BaseException:
            await response.aclose()
            raise
        return response


class _Stream:
    """The connection that brings the events of a job. It is opened again after it broke."""

    def __init__(self, connection: AsyncConnection, path: str, following: Following) -> None:
        self._connection = connection
        self._path = path
        self._following = following
        self._response: httpx.Response | None = None
        self._sent: AsyncIterator[ServerSentEvent] | None = None

    async def next_event(self) -> JobEvent | None:
        """Returns the next event, or None when there are no more; raises when the connection fails or breaks."""
        try:
            with named_failures(self._connection._url):
                return await self._read()
        except BaseException:
            await self.aclose()
            raise

    async def _read(self) -> JobEvent | None:
        if self._response is None:
            self._response = await self._connection._open_stream(self._path, self._following)
            self._sent = EventSource(self._response).aiter_sse()
        if self._following.ended:
            return None
        assert self._sent is not None
        async for sent in self._sent:
            event = self._following.read(sent)
            if event is not None:
                return event
        raise ended_early()

    async def aclose(self) -> None:
        """Closes the connection."""
        if self._response is not None:
            await self._response.aclose()
            self._response = None
