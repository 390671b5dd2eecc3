"""`/v1/live`: rovers moved on over one connection that stays, up to a thousand times a second. A WebSocket.

A message is what `POST /v1/steps` takes, and so is its answer, but the server keeps the rovers: one that is sent with
neither `state` nor `start` goes on. They end with the connection. Before the server ends, or a connection on which
nothing comes, it hands the states back.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

import orjson
import structlog
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import Message, Receive, Scope, Send

from service.access.tokens import Scope as TokenScope
from service.api.http.errors import problem, problem_members, told
from service.api.http.limits.worker_threads import OverloadedError
from service.api.http.reading import parsed
from service.api.services import Services
from service.api.v1.stepping import BYTES_AT_ONCE, SECONDS_AT_ONCE, Stepping, problems, rover_problem
from service.wire.steps.answer import encode_one, encode_steps
from service.wire.steps.fleet import Fleet, Stepped
from service.wire.steps.question import STEPS_WORDS, RoverStep, StepsQuestion, read_one, read_steps

PATH = "/v1/live"
MAX_MESSAGE_BYTES = 4 << 20
"""Of a thousand rovers with their states; a longer one ends the connection with code 1009."""

GOING_AWAY, SLOW, FAILED, REVOKED, IDLE = 1001, 1008, 1011, 4401, 4408
"""Close codes."""

_log = structlog.get_logger(__name__)


class LiveConnection:
    """One client's connection: reads, answers, and is told to stop by the clock or by the server's end."""

    def __init__(self, services: Services, scope: Scope, receive: Receive, send: Send) -> None:
        self._services, self._scope, self._receive, self._send = services, scope, receive, send
        settings = services.settings
        self._idle_s, self._slow_s, self._most = settings.live_idle_s, settings.live_slow_s, settings.max_live_rovers
        self._fleet = Fleet(self._most)
        self._task = asyncio.current_task()
        self._stop = ""  # why it is to stop: draining, idle, slow or revoked
        self._waits, self._sends = False, False
        self._since = time.monotonic()  # when it began to wait or to send
        self._kept = 0

    def end(self) -> None:
        """The server ends."""
        self._stop_for("draining", at_once=self._waits)

    def watch(self) -> None:
        """Called now and then: stops one that waits or sends for too long, or whose token is not in force any more."""
        gone = time.monotonic() - self._since
        if self._waits and gone > self._idle_s:
            self._stop_for("idle", at_once=True)
        elif self._sends and gone > self._slow_s:
            self._stop_for("slow", at_once=True)
        elif self._services.settings.require_token and not self._admitted():
            self._stop_for("revoked", at_once=self._waits or self._sends)

    def _admitted(self) -> bool:
        return self._services.access.still_holds(self._scope, TokenScope.READ)

    def _stop_for(self, why: str, *, at_once: bool) -> None:
        if self._stop:
            return
        self._stop = why
        if at_once and self._task is not None:
            self._task.cancel()

    async def run(self) -> str:
        """Until one side ends it: why."""
        try:
            while not self._stop:
                message = await self._next()
                if message["type"] == "websocket.disconnect":
                    return _ended_by(message)
                binary = message.get("bytes")
                content = binary if binary is not None else message["text"].encode()
                answer = await self._answer(content)
                self._count()
                await self._say(answer, binary=binary is not None)
        except asyncio.CancelledError:
            if not self._stop or self._task is None:
                raise
            self._task.uncancel()
        finally:
            self._services.instruments.live_rovers(-self._kept)
        await self._part()
        return self._stop

    async def _next(self) -> Message:
        self._waits, self._since = True, time.monotonic()
        try:
            return await self._receive()
        finally:
            self._waits = False

    async def _say(self, content: bytes, *, binary: bool = False) -> None:
        self._sends, self._since = True, time.monotonic()
        try:
            said: dict[str, Any] = {"bytes": content} if binary else {"text": content.decode()}
            await self._send({"type": "websocket.send", **said})
        finally:
            self._sends = False

    async def _answer(self, content: bytes) -> bytes:
        """What is answered to one message; whatever is wrong with it, the connection goes on."""
        try:
            if len(content) > BYTES_AT_ONCE:
                return await self._answer_to_many(len(content), lambda: parsed(content, STEPS_WORDS))
            document = parsed(content, STEPS_WORDS)
            rover = read_one(document)
            found = None if rover is None else self._answer_to_one(rover)
            return await self._answer_to_many(len(content), lambda: document) if found is None else found
        except Exception as error:
            described = told(error)
            return orjson.dumps({"error": {**problem_members(described), **described.members}})

    def _answer_to_one(self, rover: RoverStep) -> bytes | None:
        """What `_answer_to_many` would answer, in a fifth of the time. None where it has to."""
        if rover.dt_s > SECONDS_AT_ONCE:
            return None
        began = time.perf_counter()
        found = self._fleet.step_one(rover)
        if found is None:
            return None
        refused = isinstance(found, Exception)
        self._services.instruments.stepped(PATH, int(not refused), int(refused), time.perf_counter() - began)
        if isinstance(found, Exception):
            return encode_steps(Stepped([], {}), [rover_problem(0, rover.id, found)], with_state=False)
        return encode_one(rover.id, *found)

    async def _answer_to_many(self, size_bytes: int, document: Callable[[], object]) -> bytes:
        def read() -> StepsQuestion:
            return read_steps(document(), live=True, most=self._most)

        def answer(question: StepsQuestion, found: Stepped) -> bytes:
            return encode_steps(found, problems(question, found), with_state=question.with_state)

        return await Stepping(self._services, PATH, self._fleet, read, answer).done(size_bytes)

    def _count(self) -> None:
        now = len(self._fleet)
        if now != self._kept:
            self._services.instruments.live_rovers(now - self._kept)
            self._kept = now

    async def _part(self) -> None:
        """Hands the states back, unless the client does not read or has no token any more, and closes."""
        if self._stop == "revoked":
            await self._close(REVOKED, "revoked: the token of this connection is not in force any more")
            return
        if self._stop == "slow":
            await self._close(SLOW, f"slow reader: an answer was not taken for {self._slow_s:g} s")
            return
        rovers = [{"id": name, "state": state} for name, state in self._fleet.states().items()]
        await self._say(orjson.dumps({"event": self._stop, "rovers": rovers}))
        if self._stop == "idle":
            await self._close(IDLE, f"idle: no message came for {self._idle_s:g} s")
        else:
            await self._close(GOING_AWAY, "draining: this server ends, go on at another one")

    async def _close(self, code: int, reason: str) -> None:
        await self._send({"type": "websocket.close", "code": code, "reason": reason})


class LiveEndpoint:
    """ASGI: accepts connections, as many as may be, and watches them."""

    path = PATH

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """ASGI."""
        scope["route"] = self
        services: Services = scope["state"]["services"]
        await receive()  # that it connects
        most, there_are = services.settings.max_live_connections, services.lifecycle.live
        if services.lifecycle.ending or len(there_are) >= most:
            services.instruments.live_ended("refused")
            said = "the server ends" if services.lifecycle.ending else f"{most} live connections are open already"
            refusal = problem(told(OverloadedError(f"{said}; try again in 1 s")), PATH)
            await _refuse(refusal.status_code, refusal.raw_headers, bytes(refusal.body), send)
            return
        await send({"type": "websocket.accept"})
        await self._follow(LiveConnection(services, scope, receive, send), services)

    async def _follow(self, connection: LiveConnection, services: Services) -> None:
        there_are, instruments, why = services.lifecycle.live, services.instruments, "failed"
        there_are.add(connection)
        instruments.live_connections(1)
        clock = asyncio.create_task(_watching(connection, services))
        try:
            why = await connection.run()
        except OSError:  # gone while it was told something
            why = "lost"
        finally:
            clock.cancel()
            there_are.remove(connection)
            instruments.live_connections(-1)
            instruments.live_ended(why)


async def _watching(connection: LiveConnection, services: Services) -> None:
    period = min(1.0, services.settings.live_slow_s / 4, services.settings.live_idle_s / 4)
    while True:
        await asyncio.sleep(period)
        connection.watch()


async def _refuse(status: int, headers: list[tuple[bytes, bytes]], body: bytes, send: Send) -> None:
    await send({"type": "websocket.http.response.start", "status": status, "headers": headers})
    await send({"type": "websocket.http.response.body", "body": body})


def _ended_by(message: Message) -> str:
    """Why a connection is over that the server did not end."""
    code = message.get("code", 1005)
    return {1000: "closed", 1001: "closed", 1005: "closed", 1009: "too_large"}.get(code, "lost")


async def _plain(_: Request) -> Response:
    """What somebody gets who asks the address with a browser."""
    detail = "open a WebSocket here; docs/asyncapi.yaml says what its messages are"
    raise HTTPException(426, detail, {"Upgrade": "websocket", "Connection": "Upgrade"})


routes = (WebSocketRoute(PATH, LiveEndpoint()), Route(PATH, _plain, include_in_schema=False))
