"""Answers that need no waiting, made where the connection reads their requests: no task, no coroutine, no messages.

Most questions of one scenario are such. All others go through the middlewares, as these do where this way is off: each
of its steps is one of theirs, and a test compares the answers.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from fastapi import Request
from starlette.types import Scope

from service.access.addresses import Network
from service.api.http.answers.head_lines import lines_of
from service.api.http.answers.written import Written
from service.api.http.errors import ErrorAnswers
from service.api.http.instruments import Instruments
from service.api.http.lanes import Lane
from service.api.http.limits.answer_bytes import WaitingBytes
from service.api.http.limits.body_limit import announces_a_body
from service.api.http.request_log import client_of, id_of, own_lines, write_down
from service.log import request_id


class Answered(NamedTuple):
    """An answer as it is sent; `lines` are all of its head but what the server says in every one."""

    status: int
    lines: bytes
    body: bytes


class AnswersAtOnce:
    """For GETs of those `lanes` that know how; `trusted` are proxies. To be used on the event loop."""

    def __init__(
        self,
        lanes: Iterable[Lane],
        waiting: WaitingBytes,
        answer_to: ErrorAnswers,
        instruments: Instruments,
        trusted: Sequence[Network] = (),
    ) -> None:
        self._at_once = {each.path: each.at_once for each in lanes if each.at_once and each.method == "GET"}
        self._waiting, self._answer_to, self._instruments = waiting, answer_to, instruments
        self._trusted = trusted
        self._noted: list[tuple[str, int, float, str, str]] = []

    def answer(self, scope: Scope) -> Answered | None:
        """The answer to a request; None for one that has to go through the middlewares."""
        path = scope["path"]
        at_once = self._at_once.get(path)
        if at_once is None or scope["method"] != "GET" or scope["root_path"]:
            return None
        if self._waiting.is_full or scope["state"]["services"].settings.require_token or announces_a_body(scope):
            return None
        began, name = time.perf_counter(), id_of(scope)
        token = request_id.set(name)
        try:
            response = at_once(Request(scope))
        except Exception as error:  # as from the middlewares: a client always gets an answer
            response = self._answer_to(error, path)
        finally:
            request_id.reset(token)
        if response is None:
            return None
        client, status = client_of(scope["client"], scope["headers"], self._trusted), response.status_code
        seconds = time.perf_counter() - began
        if not self._noted:  # in the next round of the loop: this one first sends what was answered
            asyncio.get_running_loop().call_soon(self._write_down)
        self._noted.append((path, status, seconds, name, client))
        lines = response.lines() if isinstance(response, Written) else lines_of(response.raw_headers)
        return Answered(status, lines + own_lines(name), bytes(response.body))

    def _write_down(self) -> None:
        noted, self._noted = self._noted, []
        for each in noted:
            write_down(self._instruments, "GET", *each)
