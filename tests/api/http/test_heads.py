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

from service.api.http.answers.written import Written
from service.api.http.connections.cycle import Cycle
from service.api.http.reading import query_pairs
from service.api.http.sent_headers import all_sent, first_sent

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


def written_by(kind: type[RequestResponseCycle], head, **asked) -> bytes:
    """The bytes of an answer, and whether the connection stays."""
    return b"".join(writes(kind, head, **asked))


def writes(
    kind: type[RequestResponseCycle], head, *, method="GET", keep_alive=True, own=(), status=200, body=(BODY,)
) -> list[bytes]:
    """The same, write by write; `body` comes in so many messages."""
    sent: list[bytes] = []
    closed: list[bool] = []
    transport = SimpleNamespace(write=sent.append, close=lambda: closed.append(True), is_closing=lambda: bool(closed))
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
        await cycle.send({"type": "http.response.start", "status": status, "headers": head})
        for left, piece in zip(reversed(range(len(body))), body, strict=True):
            await cycle.send({"type": "http.response.body", "body": piece, "more_body": left > 0})

    asyncio.run(send())
    return [*sent, bytes(closed)]


@pytest.mark.parametrize("keep_alive", [True, False])
@pytest.mark.parametrize("method", ["GET", "HEAD"])
@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_a_head_is_what_uvicorn_would_write(head, method, keep_alive):
    for own in ((), [(b"date", b"today"), (b"server", b"ours")]):
        asked = {"method": method, "keep_alive": keep_alive, "own": own}
        assert written_by(Cycle, head, **asked) == written_by(RequestResponseCycle, head, **asked)


@pytest.mark.parametrize("status", [200, 204, 206, 304])
@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_so_is_what_has_no_body_and_what_comes_in_pieces(status, method):
    without = {"method": method, "status": status, "body": (b"",)}
    tag = [(b"etag", b'"1"')]
    assert written_by(Cycle, tag, **without) == written_by(RequestResponseCycle, tag, **without)
    pieces = {"method": method, "body": (BODY[:3], b"", BODY[3:])}
    assert written_by(Cycle, [LENGTH], **pieces) == written_by(RequestResponseCycle, [LENGTH], **pieces)


def test_head_and_body_are_one_write_where_that_is_less_work():
    assert len(writes(Cycle, [LENGTH])) == 2  # and whether the connection stays
    large = bytes(1 << 20)
    assert writes(Cycle, [(b"content-length", b"1048576")], body=(large,))[1] is large


@pytest.mark.parametrize("body", [BODY[:-1], BODY + b"0"])
def test_a_body_that_is_not_as_long_as_announced_is_no_answer(body):
    with pytest.raises(RuntimeError, match="Response content"):
        writes(Cycle, [LENGTH], body=(body,))


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
