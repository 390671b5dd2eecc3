"""A service over an S3 server: what it costs while nobody asks, who sees a promotion when, and a server that hangs."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import httpx
import pytest

from model_store import ModelStore
from tests.api.conftest import PLAIN, QUESTION, RUN, wait_until
from tests.fair_clock import fair_clock
from tests.jobs.nursery import until
from tests.s3 import S3Server
from tests.twin.published import publish_banded

pytestmark = pytest.mark.processes

TOKEN = "a token of the remote store"
ADMIN = {"Authorization": f"Bearer {TOKEN}"}
WINDOW_S = 9.0
PER_MINUTE = 30
PROMOTED_WITHIN_S = 5.0
ANSWER_WITHIN_S = 5.0
DRAIN_S, GRACE_S = 1, 6
NOT_IN_MEMORY = ("/v1/models", "/v1/models/viper-lunar", "/v1/models/viper-lunar/aliases", "/v2/models/viper-lunar")


@pytest.fixture(scope="module")
def s3(tmp_path_factory):
    with S3Server.started(tmp_path_factory.mktemp("s3")) as server, pytest.MonkeyPatch.context() as patch:
        for name, value in server.environment.items():
            patch.setenv(name, value)
        store = ModelStore.open(server.url())
        for actor in ("one", "two"):
            publish_banded(store, "viper-lunar")
            store.move_alias("viper-lunar", "champion", 1, actor=actor, reason="a test")
        yield server


@contextmanager
def replica(s3, folder, **settings):
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    chosen = {
        "store_url": s3.url(),
        "port": port,
        "log_level": "error",
        "admin_token": TOKEN,
        "start_worker": "false",
        "jobs_database_url": f"sqlite:///{folder}/jobs-{port}.sqlite",
        "drain_s": DRAIN_S,
        "shutdown_grace_s": GRACE_S,
    } | settings
    environment = os.environ | {f"ROVER_TWIN_{name.upper()}": str(value) for name, value in chosen.items()}
    with (
        subprocess.Popen([sys.executable, "-c", RUN], env=environment, stderr=subprocess.PIPE, text=True) as process,
        httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60, **PLAIN) as client,
    ):
        try:
            wait_until(lambda: client.get("/health/ready").status_code == 200, process)
            yield client, process
        finally:
            process.kill()


@pytest.fixture(scope="module")
def two(s3, tmp_path_factory):
    folder = tmp_path_factory.mktemp("jobs")
    with replica(s3, folder) as (first, _), replica(s3, folder) as (second, _):
        yield first, second


def champion(client):
    return client.get("/v1/predictions", params=QUESTION).json()["model"]["version"]


def test_an_idle_service_asks_little_and_a_list_of_models_nothing(s3, two):
    for client in two:
        assert client.get("/v1/models").status_code == 200
    before, began = s3.counts(), time.monotonic()
    time.sleep(WINDOW_S)
    idle, idle_s = (s3.counts() - before).total(), time.monotonic() - began

    assert 0 < idle / len(two) * 60 / idle_s <= PER_MINUTE

    before, began = s3.counts(), time.monotonic()
    for _ in range(50):
        for client in two:
            assert client.get("/v1/models").json()["models"][0]["versions"] == [1, 2]
    asked = (s3.counts() - before).total()
    assert asked <= 4 + (time.monotonic() - began)  # nothing but looks of the two that fell due meanwhile


def test_a_promotion_shows_at_once_where_it_was_made_and_soon_everywhere(s3, two):
    first, second = two
    version = 3 - champion(first)
    address = "/v1/models/viper-lunar/aliases/champion"
    tag = first.get(address).headers["etag"]

    moved = first.put(address, json={"version": version, "reason": "a test"}, headers={**ADMIN, "If-Match": tag})

    assert moved.status_code == 200, moved.text
    assert first.get("/v1/models").json()["models"][0]["aliases"]["champion"] == version
    with fair_clock() as clock:
        clock.wait_until(lambda: champion(first) == version, 2.0, "where it was made")
        clock.wait_until(lambda: champion(second) == version, PROMOTED_WITHIN_S - clock(), "elsewhere")
    until(lambda: second.get("/v1/models").json()["models"][0]["aliases"]["champion"] == version, 10)


@pytest.mark.parametrize("how", ["hang", "trickle", "frozen"])
def test_a_store_that_hangs_is_given_up_in_seconds_and_keeps_nobody_else(s3, tmp_path, how):
    """Also when more ask for it than there are threads, and also the end of the process."""
    with replica(s3, tmp_path) as (client, process), s3.misbehaving(how):
        time.sleep(0.1)

        def ask(address):
            with httpx.Client(base_url=client.base_url, timeout=60, **PLAIN) as own:
                began = time.monotonic()
                status = own.get(address).status_code
                return status, time.monotonic() - began

        with ThreadPoolExecutor(40) as pool:
            asked = [pool.submit(ask, address) for address in NOT_IN_MEMORY * 10]
            time.sleep(0.5)
            assert client.get("/v1/predictions", params=QUESTION).status_code == 200
            assert not all(each.done() for each in asked)  # and it did not wait for them
            answers = [each.result() for each in asked]
        assert {status for status, _ in answers} <= {200, 503}
        assert max(took for _, took in answers) <= ANSWER_WITHIN_S
        ready = until(lambda: stale(client), 60, "readiness says since when")
        assert ready["status"] == "ready"
        metrics = client.get("/metrics").text
        assert number(metrics, "rover_twin_aliases_confirmed_age_seconds") > 4
        until(lambda: number(client.get("/metrics").text, "rover_twin_alias_looks_failed_total") >= 1, 30)
        began = time.monotonic()
        process.send_signal(signal.SIGTERM)
        process.wait(60)
        assert time.monotonic() - began <= DRAIN_S + GRACE_S


def stale(client):
    ready = client.get("/health/ready").json()
    return ready if ready.get("aliases_stale_since") else None


def number(metrics, name):
    return float(next(line for line in metrics.splitlines() if line.startswith(name + " ")).split()[1])


def test_a_store_that_answers_again_is_followed_again(s3, tmp_path):
    with replica(s3, tmp_path) as (client, _):
        with s3.misbehaving("frozen"):
            until(lambda: stale(client), 60)
        until(lambda: not stale(client), 60)
        assert client.get("/v1/models").status_code == 200
