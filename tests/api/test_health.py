"""Alive, ready, and the end of the process."""

from __future__ import annotations

import signal
import time
from concurrent.futures import ThreadPoolExecutor

import pytest


def test_ready_proves_itself_by_a_prediction(service):
    answer = service.get("/health/ready").json()

    assert answer["status"] == "ready"
    assert answer["model"] == {"name": "viper-lunar", "version": 1, "alias": "champion"}
    same = service.predict(slope_deg=10, horizon_s=1, dt_s=0.5).json()
    assert answer["probe"]["final_x_m"] == same["summary"]["final_x_m"]
    assert answer["probe"]["compute_ms"] > 0
    assert set(answer) == {"status", "model", "probe"}


@pytest.mark.slow
def test_draining_turns_readiness_off_and_nothing_else(serve, store, publish, move):
    move(store, publish(store))
    service = serve()
    service.wait_ready()

    service.lifecycle.draining = True

    assert service.get("/health/ready").status_code == 503
    assert service.get("/health/live").status_code == 200
    assert service.predict().status_code == 200


def test_sigterm_turns_readiness_off_first_and_running_requests_finish(store, publish, move, question, own_process):
    move(store, publish(store, architecture="paper_network"))
    client, process = own_process(drain_s=1.5)
    heavy = question | {"horizon_s": 600, "dt_s": 0.00601}

    process.send_signal(signal.SIGTERM)
    while (refused := client.get("/health/ready")).status_code == 200:
        time.sleep(0.02)
    with ThreadPoolExecutor(8) as pool:
        asked = [pool.submit(client.get, "/v1/predictions", params=heavy) for _ in range(8)]
        answers = [each.result() for each in asked]

    assert refused.status_code == 503
    assert "shutting down" in refused.json()["detail"]
    assert [answer.status_code for answer in answers] == [200] * 8
    assert {len(answer.json()["trajectory"]["x_m"]) for answer in answers} == {99_835}
    assert process.wait(timeout=20) in (0, -signal.SIGTERM)
    assert process.stderr.read() == ""
