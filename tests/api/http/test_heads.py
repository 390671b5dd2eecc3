"""Heads of answers and of requests: what is quick says what the libraries it stands for say."""

from __future__ import annotations

import asyncio
import logging
from types import SimpleNamespace
from urllib.parse import parse_qsl

import pytest
from fastapi import Request, Response
from hypothesis import example, given
from hypothesis import strategies as st
from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

from service.api.http.connections.cycle import Cycle
from service.api.http.reading import query_pairs
from service.api.http.sent_headers import all_sent, first_sent
from service.api.http.written import Written

BODY = b"0123456789"
LENGTH = (b"content-length", b"10")
HEADS = {
    "plain": [(b"content-type", b"text/csv"), LENGTH],
    "capitals": [(b"ETag", b'"1"'), (b"Vary", b"Accept"), LENGTH],
    "without a length": [(b"content-type", b"text/csv")],
    "chunked": [(b"transfer-encoding", b"chunked")],
    "the connection ends": [(b"connection", b"close"), LENGTH],
    "twice": [(b"set-cookie", b"a"), (b"set-cookie", b"b"), LENGTH],
}
WRONG = {"name": (b"a b", b"c"), "value": (b"a", b"b\r\nc: d"), "tag": (b"etag", b"\x00")}


def written_by(kind: type[RequestResponseCycle], head, *, method="GET", keep_alive=True, own=()) -> bytes:
    """The bytes of an answer, and whether the connection stays."""
    sent: list[bytes] = []
    closed: list[bool] = []
    transport = SimpleNamespace(write=sent.append, close=lambda: closed.append(True))
    cycle = kind(
        scope={"method": method, "type": "http"},
        transport=transport,
        flow=SimpleNamespace(write_paused=False),
        logger=logging.getLogger(),
        access_logger=logging.getLogger(),
        access_log=False,
        default_headers=list(own),
        message_event=asyncio.Event(),
        expect_100_continue=False,
        keep_alive=keep_alive,
        on_response=lambda: None,
    )

    async def send() -> None:
        await cycle.send({"type": "http.response.start", "status": 200, "headers": head})
        await cycle.send({"type": "http.response.body", "body": BODY})

    asyncio.run(send())
    return b"".join(sent) + bytes(closed)


@pytest.mark.parametrize("keep_alive", [True, False])
@pytest.mark.parametrize("method", ["GET", "HEAD"])
@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_a_head_is_what_uvicorn_would_write(head, method, keep_alive):
    for own in ((), [(b"date", b"today"), (b"server", b"ours")]):
        asked = {"method": method, "keep_alive": keep_alive, "own": own}
        assert written_by(Cycle, head, **asked) == written_by(RequestResponseCycle, head, **asked)


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_nobody_puts_lines_of_his_own_into_a_head(wrong):
    for _ in range(2):  # not the second time either
        with pytest.raises(RuntimeError, match="Invalid HTTP header"):
            written_by(Cycle, [wrong, LENGTH])


@pytest.mark.parametrize("status", [200, 206, 304])
def test_headers_are_what_starlette_would_make_of_them(status):
    headers = {"Vary": "Accept", "ETag": '"1"', "Content-Type": "application/json", "X-Name": "\xe9"}
    theirs = Response(b"" if status == 304 else BODY, status, headers=headers)
    assert Written(theirs.body, headers, status=status).raw_headers == theirs.raw_headers


@given(st.text(st.sampled_from("ab=&+%41;?\xe9 #"), max_size=30))
@example("a=1&b=2&a=")
@example("&&a&=b&")
def test_a_query_is_read_as_the_standard_library_reads_it(text):
    query = text.encode("latin-1")
    request = Request({"type": "http", "query_string": query, "headers": []})
    assert query_pairs(request) == parse_qsl(query.decode("latin-1"), keep_blank_values=True)


def test_headers_that_came_several_times_are_found_in_order():
    scope = {"headers": [(b"a", b"1"), (b"b", b"\xe9"), (b"a", b"2")]}
    assert (first_sent(scope, b"a"), first_sent(scope, b"b"), first_sent(scope, b"c")) == ("1", "\xe9", None)
    assert (all_sent(scope, b"a"), all_sent(scope, b"c")) == (["1", "2"], [])
