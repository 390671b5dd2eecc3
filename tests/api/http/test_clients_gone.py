"""A client that hangs up is no fault of the service: status 499, one line, no traceback, and no alarm."""

from __future__ import annotations

import logging
import socket
import struct
import time

import pytest

from service.log import REQUESTS
from tests.api.conftest import TOKEN

ADDRESSES = [
    ("POST", "/v1/predictions"),
    ("POST", "/v1/predictions/batch"),
    ("POST", "/v1/drives"),
    ("POST", "/v1/steps"),
    ("POST", "/v2/models/viper-lunar/infer"),
    ("POST", "/v2/repository/index"),
    ("PUT", "/v1/models/viper-lunar/aliases/champion"),
    ("POST", "/v1/admin/training-jobs"),
    ("POST", "/v1/admin/datasets"),
    ("POST", "/v1/admin/models/viper-lunar/versions/1/archive"),
]
ROUNDS = 10


def hang_up(running, method, path, *, reset):
    """Sends a head and less of a body than it announces."""
    host, port = running.url.removeprefix("http://").split(":")
    head = f"{method} {path} HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {TOKEN}\r\n"
    head += "Content-Type: application/json\r\nContent-Length: 1000\r\n\r\n"
    with socket.create_connection((host, int(port))) as connection:
        connection.sendall(head.encode() + b'{"a"')
        time.sleep(0.03)
        if reset:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))


def counted(running):
    """Answered requests by status."""
    found = {}
    for line in running.get("/metrics").text.splitlines():
        if line.startswith("rover_twin_http_requests_total{"):
            status = line.partition('status="')[2].partition('"')[0]
            found[status] = found.get(status, 0) + float(line.rpartition(" ")[2])
    return found


@pytest.mark.processes
def test_of_a_hundred_clients_that_hang_up_none_is_a_fault(admin, store, publish, move, caplog):
    move(store, publish(store))
    admin.wait_ready()
    before = counted(admin)
    caplog.clear()
    caplog.set_level(logging.INFO, logger=REQUESTS)

    for number in range(ROUNDS):
        for method, path in ADDRESSES:
            hang_up(admin, method, path, reset=bool(number % 2))
    wanted, until = ROUNDS * len(ADDRESSES), time.monotonic() + 20
    while (gone := counted(admin).get("499", 0)) < wanted and time.monotonic() < until:
        time.sleep(0.1)

    after = counted(admin)
    assert gone == wanted
    faults = {status: count for status, count in after.items() if status.startswith("5")}
    assert faults == {status: count for status, count in before.items() if status.startswith("5")}
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR or record.exc_info]
    rows = admin.get("/v1/admin/audit", limit=200).json()["entries"]
    assert [each["status"] for each in rows] == [499] * (4 * ROUNDS)
