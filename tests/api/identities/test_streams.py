"""Streams that are open while tokens come and go."""

from __future__ import annotations

import json
import time

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from service.access.token_file import remove
from service.api.v1.live import REVOKED
from tests.api.identities.conftest import scraped
from tests.api.training import job_store, submit


def test_the_websocket_needs_the_token_too(serve, file, give, store, publish, move):
    move(store, publish(store))
    joe = give("joe", "read")
    service = serve(tokens_file=file, require_token=True, start_worker=False)
    address = service.url.replace("http", "ws") + "/v1/live"

    with pytest.raises(InvalidStatus) as caught:
        connect(address, proxy=None).close()
    assert caught.value.response.status_code == 401
    assert json.loads(caught.value.response.body)["type"].endswith("unauthorized")
    with connect(address, proxy=None, additional_headers=joe) as connection:
        connection.send("{}")
        assert connection.recv(timeout=10)


def talk(connection, *, busy):
    """Until it ends; a client that is not `busy` only listens."""
    for _ in range(2000):
        if busy:
            connection.send("{}")
        connection.recv(timeout=20)
        time.sleep(0.01)


@pytest.mark.parametrize("busy", [False, True], ids=["quiet", "busy"])
def test_a_websocket_whose_token_is_revoked_is_closed(serve, file, give, store, publish, move, busy):
    move(store, publish(store))
    joe, ada = give("joe", "read"), give("ada", "read")
    service = serve(tokens_file=file, require_token=True, start_worker=False)
    address = service.url.replace("http", "ws") + "/v1/live"

    with (
        connect(address, proxy=None, additional_headers=joe) as revoked,
        connect(address, proxy=None, additional_headers=ada) as other,
    ):
        remove(file, "joe")
        with pytest.raises(ConnectionClosed) as caught:
            talk(revoked, busy=busy)
        assert caught.value.rcvd.code == REVOKED
        assert "token" in caught.value.rcvd.reason
        other.send("{}")
        assert other.recv(timeout=10)
    ended = {"reason": "revoked", "headers": ada}
    assert scraped(service.client, "live_connections_ended_total", **ended) == 1


def test_without_a_token_for_everything_a_websocket_asks_for_none(named, publish, move):
    move(named.store, 1)
    named.wait_ready()
    with connect(named.url.replace("http", "ws") + "/v1/live", proxy=None) as connection:
        time.sleep(1.5)
        connection.send("{}")
        assert connection.recv(timeout=10)


def test_events_of_a_job_end_when_the_token_is_revoked(serve, tmp_path, file, give):
    job_store(tmp_path)
    joe, ada = give("joe", "read"), give("ada", "admin")
    service = serve(tokens_file=file, start_worker=False)
    service.client.headers.update(ada)
    address = submit(service.client)["links"]["events"]

    with service.client.stream("GET", address, headers=joe, timeout=20) as answer:
        events = answer.iter_lines()
        assert "retry" in next(events)
        remove(file, "joe")
        assert '"queued"' in "".join(events)  # and then it ends
    assert service.client.get(address, headers=joe).status_code == 401
