"""How uploads come in: bounded in size, time and number, never whole in memory, and nothing is left of them."""

from __future__ import annotations

import os
import socket
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from service.api.http import upload_body
from tests.api.chrono_uploads import archive
from tests.api.conftest import ADMIN, TOKEN, serving
from tests.api.http.test_body_limit import exchange

LIMIT = 200_000
DATASETS = "/v1/admin/datasets"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The only place for temporary files while these tests run."""
    path = tmp_path_factory.mktemp("temporary")
    before, tempfile.tempdir = tempfile.tempdir, str(path)
    yield path
    tempfile.tempdir = before


@pytest.fixture(scope="module")
def small(tmp_path_factory, folder):
    store = tmp_path_factory.mktemp("store")
    with serving(store, admin_token=TOKEN, start_worker=False, max_upload_bytes=LIMIT) as running:
        running.client.headers.update(ADMIN)
        yield running


def head(*lines, kind="application/octet-stream"):
    fields = ["Host: x", f"Authorization: Bearer {TOKEN}", f"Content-Type: {kind}", *lines]
    return (f"POST {DATASETS} HTTP/1.1\r\n" + "\r\n".join(fields) + "\r\n\r\n").encode()


def chunk(size):
    return f"{size:x}\r\n".encode() + b"x" * size + b"\r\n"


@contextmanager
def sending(service, *data):
    """A client that has sent this and sends no more for now."""
    host, port = service.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=20) as connection:
        for part in data:
            connection.sendall(part)
        yield connection


def left_in(folder):
    return [path.name for path in folder.glob("rover-twin-upload-*")]


def wait_for(condition, timeout_s=30.0):
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.parametrize("length", [LIMIT + 1, 10**12, 10**17])
def test_an_announced_length_over_the_limit_is_refused_at_once(small, folder, length):
    answer = exchange(small, head(f"Content-Length: {length}"))  # gives up long before a body would be missed

    assert answer.startswith(b"HTTP/1.1 413"), answer
    assert b"connection: close" in answer.lower()
    assert b"urn:rover-twin:problem:body-too-large" in answer
    assert left_in(folder) == []


def test_who_asks_first_is_not_told_to_go_on(small):
    answer = exchange(small, head(f"Content-Length: {LIMIT + 1}", "Expect: 100-continue"))

    assert answer.startswith(b"HTTP/1.1 413"), answer


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["application/octet-stream", "multipart/form-data; boundary=cut"])
def test_a_body_without_length_is_counted_while_it_comes_in(small, folder, kind):
    part = b'--cut\r\nContent-Disposition: form-data; name="file"; filename="x"\r\n\r\n'
    first = f"{len(part):x}\r\n".encode() + part + b"\r\n"

    answer = exchange(small, head("Transfer-Encoding: chunked", kind=kind), first, *[chunk(50_000)] * 5)

    assert answer.startswith(b"HTTP/1.1 413"), answer
    assert b"connection: close" in answer.lower()
    wait_for(lambda: left_in(folder) == [])
    assert small.store.dataset_ids() == []


def test_a_client_that_only_sends_still_gets_the_answer(small):
    announced = small.client.post(DATASETS, content=b"x" * 5_000_000)
    streamed = small.client.post(DATASETS, content=iter([b"x" * 100_000] * 50))

    assert (announced.status_code, streamed.status_code) == (413, 413)


@pytest.mark.processes
def test_a_body_of_exactly_the_limit_is_read(small):
    assert small.client.post(DATASETS, content=b"x" * LIMIT).status_code == 422
    assert small.client.post(DATASETS, content=b"x" * (LIMIT + 1)).status_code == 413


def test_the_larger_limit_is_for_uploads_only(small):
    for path in ("/v1/predictions", f"{DATASETS}/x", f"{DATASETS}/", "/v1/admin/training-jobs"):
        answer = small.client.post(path, content=b"x" * (64 * 1024 + 1), headers={"Content-Type": "application/json"})
        assert answer.status_code == 413, path
    assert small.client.request("GET", DATASETS, content=b"x" * (64 * 1024 + 1)).status_code == 413


@pytest.mark.processes
@pytest.mark.parametrize(
    "data",
    [
        (head("Content-Length: 1000"), b"x" * 10),
        (head("Transfer-Encoding: chunked"), chunk(1000)),
        (
            head("Content-Length: 1000", kind="multipart/form-data; boundary=cut"),
            b'--cut\r\nContent-Disposition: form-data; name="file"\r\n\r\nx',
        ),
    ],
    ids=["less than announced", "chunks without an end", "half a form"],
)
def test_of_a_client_that_goes_away_nothing_is_left(small, folder, data):
    with sending(small, *data):
        wait_for(lambda: len(left_in(folder)) == 1)
    wait_for(lambda: left_in(folder) == [])

    assert small.store.dataset_ids() == []
    assert small.client.post(DATASETS, content=b"x").status_code == 422  # its place is free again


@pytest.mark.slow
def test_a_client_that_stops_sending_is_not_waited_for(small, folder, monkeypatch):
    monkeypatch.setattr(upload_body, "IDLE_S", 0.3)

    answer = exchange(small, head("Content-Length: 1000"), b"x" * 10)

    assert answer.startswith(b"HTTP/1.1 408"), answer
    assert b"urn:rover-twin:problem:upload-stalled" in answer
    assert b"connection: close" in answer.lower()
    assert left_in(folder) == []


@pytest.mark.processes
def test_a_third_upload_at_once_is_turned_away_until_one_has_ended(small, folder):
    slow = (head("Content-Length: 1000"), b"x")
    with sending(small, *slow):
        with sending(small, *slow):
            wait_for(lambda: len(left_in(folder)) == 2)
            refused = small.client.post(DATASETS, content=archive(runs=1))
            assert refused.status_code == 503
            assert refused.json()["type"] == "urn:rover-twin:problem:overloaded"
            assert int(refused.headers["retry-after"]) >= 1
            assert small.get("/health/live").status_code == 200
        wait_for(lambda: len(left_in(folder)) == 1)
        assert small.client.post(DATASETS, content=archive(runs=1)).status_code == 201


@pytest.mark.slow
def test_what_a_killed_process_left_is_removed_at_the_next_start_and_nothing_else(small, folder, tmp_path):
    forgotten = folder / "rover-twin-upload-forgotten"
    (forgotten / "import-x").mkdir(parents=True)
    (forgotten / "import-x" / "body").write_bytes(b"x")
    another, elsewhere = folder / "another-upload", tmp_path / "elsewhere"
    for path in (another, elsewhere):
        path.mkdir()
    (folder / "rover-twin-upload-link").symlink_to(elsewhere)

    with sending(small, head("Content-Length: 1000"), b"x"):  # one that is in work, of a process that lives
        wait_for(lambda: len(left_in(folder)) == 3)
        with serving(tmp_path / "store"):
            wait_for(lambda: not forgotten.exists())
        assert len(left_in(folder)) == 2
        assert another.exists()
        assert elsewhere.exists()
    (folder / "rover-twin-upload-link").unlink()
    wait_for(lambda: left_in(folder) == [])
    another.rmdir()


def test_a_large_upload_is_never_whole_in_memory(store, own_process, publish, move):
    move(store, publish(store))
    client, process = own_process(admin_token=TOKEN, start_worker="false")
    client.headers.update(ADMIN)
    before = peak_kib(process)

    answer = client.post(DATASETS, content=iter([os.urandom(1 << 20)] * 96))

    assert answer.status_code == 422, answer.text
    assert peak_kib(process) - before < 32 * 1024


def peak_kib(process):
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0])
