"""Several server processes on one port: one view of the metrics, one training worker, one end."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import httpx
import psutil
import pytest

from tests.api.conftest import TOKEN
from tests.api.test_metrics import scraped

WORKERS = 2


def eventually(check, within_s: float = 20.0):
    end = time.monotonic() + within_s
    while not (found := check()):
        assert time.monotonic() < end, "did not happen in time"
        time.sleep(0.05)
    return found


def servers(process) -> list[psutil.Process]:
    """The server processes below the one that was started."""
    return [each for each in psutil.Process(process.pid).children() if "run_process" in command(each)]


def command(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.NoSuchProcess:  # or a zombie, which is one of them
        return ""


def imports(process: psutil.Process) -> bool:
    """Whether Python itself has started, and is about to load what it needs."""
    return any("site-packages" in each.path for each in process.memory_maps())


def everything_below(process) -> list[psutil.Process]:
    return psutil.Process(process.pid).children(recursive=True)


@pytest.fixture
def several(store, publish, move, own_process, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))  # a killed one leaves its metrics behind

    def start(architecture="zero", **settings):
        move(store, publish(store, architecture=architecture))
        client, process = own_process(workers=WORKERS, threads=1, **settings)
        # a connection of its own for each request, so that all processes get some
        client = httpx.Client(base_url=client.base_url, timeout=60, limits=httpx.Limits(max_keepalive_connections=0))
        eventually(lambda: scraped(client).of("server_processes") == WORKERS)
        return client, process

    return start


def asked(client, question, times) -> None:
    with ThreadPoolExecutor(8) as pool:
        answers = pool.map(lambda _: client.get("/v1/predictions", params=question).status_code, range(times))
        assert set(answers) == {200}


def predictions(client) -> float:
    return scraped(client).of("predictions_total", model_name="viper-lunar", model_version="1")


@pytest.mark.kills
def test_all_processes_answer_and_any_of_them_tells_of_all_also_after_one_died(several, question):
    client, process = several()
    asked(client, question, 60)
    assert len(servers(process)) == WORKERS
    assert {predictions(client) for _ in range(2 * WORKERS)} == {60}

    victim = servers(process)[0]
    victim.kill()
    eventually(lambda: victim.pid not in {each.pid for each in servers(process)} and len(servers(process)) == WORKERS)
    eventually(lambda: scraped(client).of("server_processes") == WORKERS)
    assert predictions(client) == 60  # what a dead process counted stays counted
    asked(client, question, 40)
    assert {predictions(client) for _ in range(2 * WORKERS)} == {100}
    assert scraped(client).of("http_requests_in_progress") == 1


def test_sigterm_turns_readiness_off_first_and_running_requests_of_all_processes_finish(several, question):
    client, process = several("paper_network", drain_s=1.5)
    below = everything_below(process)
    heavy = question | {"horizon_s": 600, "dt_s": 0.00601}

    process.send_signal(signal.SIGTERM)
    eventually(lambda: {client.get("/health/ready").status_code for _ in range(2 * WORKERS)} == {503})
    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(client.get, "/v1/predictions", params=heavy) for _ in range(4)]
        answers = [each.result().status_code for each in asked]

    assert answers == [200] * 4
    assert process.wait(timeout=30) == -signal.SIGTERM
    assert [each for each in below if each.is_running() and each.status() != psutil.STATUS_ZOMBIE] == []


def test_an_interrupt_is_passed_on_once_and_ends_without_a_traceback_also_while_it_starts(several, own_process, store):
    _, ready = several()
    below = everything_below(ready)
    environment = os.environ | {"ROVER_TWIN_PORT": "0", "ROVER_TWIN_STORE_URL": store.location}
    in_background = ["sh", "-c", 'trap "" INT; exec "$@"', "sh"]  # as a script leaves it to what it starts with `&`
    run = [*in_background, sys.executable, "-m", "service", "serve", "--workers", str(WORKERS)]
    with subprocess.Popen(run, env=environment, stderr=subprocess.PIPE, text=True) as starting:
        eventually(lambda: [imports(each) for each in servers(starting)] == [True] * WORKERS)
        for process in (ready, starting):
            process.send_signal(signal.SIGINT)
        codes = [process.wait(timeout=30) for process in (ready, starting)]

        assert codes == [-signal.SIGINT, 130]  # the command turns it into an exit code
        assert "Traceback" not in starting.stderr.read()
    assert not [each for each in below if each.is_running() and each.status() != psutil.STATUS_ZOMBIE]


@pytest.mark.parametrize("workers", [1, WORKERS])
def test_an_end_resets_no_client_that_was_let_in(store, publish, move, own_process, question, workers):
    move(store, publish(store))
    client, process = own_process(workers=workers, threads=1, drain_s=0)
    address = client.base_url.host, client.base_url.port
    ask = f"GET /v1/predictions?{httpx.QueryParams(question)} HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n".encode()
    told: Counter[str] = Counter()

    def visit() -> None:
        while not told["refused"]:
            try:
                with socket.create_connection(address, timeout=20) as connection:
                    connection.sendall(ask)
                    told["answered" if connection.recv(64).startswith(b"HTTP/1.1 200 ") else "dropped"] += 1
                    while connection.recv(1 << 16):
                        pass
            except ConnectionRefusedError:
                told["refused"] += 1
            except OSError:
                told["reset"] += 1

    with ThreadPoolExecutor(32) as pool:
        visits = [pool.submit(visit) for _ in range(32)]
        eventually(lambda: told["answered"] > 100)
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=30)
        [each.result() for each in visits]

    # one may come between the last look at the door and its close, or be too slow to ask on a busy machine
    assert told["dropped"] + told["reset"] <= 3
    assert told["refused"] > 0


@pytest.mark.kills
def test_the_server_processes_do_not_outlive_the_one_that_started_them(several):
    _, process = several(drain_s=0)
    below = everything_below(process)
    process.kill()
    process.wait()
    eventually(lambda: not [each for each in below if each.is_running() and each.status() != psutil.STATUS_ZOMBIE])


def test_together_they_keep_one_training_worker(several):
    client, process = several(admin_token=TOKEN)

    def training_workers() -> int:
        return sum("--supervised" in command(each) for each in everything_below(process))

    eventually(lambda: training_workers() == 1)
    time.sleep(1)  # another one would have come by now
    assert training_workers() == 1
    for _ in range(2 * WORKERS):  # the token is known to all
        assert client.get("/v1/admin/training-jobs", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200
        assert client.get("/v1/admin/training-jobs").status_code == 401


def test_a_port_in_use_ends_the_start(store, own_process):
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(AssertionError, match="Address already in use"):
        own_process(workers=2, port=taken.getsockname()[1], log_level="error")
