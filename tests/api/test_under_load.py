"""While heavy predictions run: the loop answers, too many are turned away, aliases move without a failed request."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from tests.fair_clock import fair_clock


@pytest.fixture
def clock():
    with fair_clock() as clock:
        yield clock


def ask(service, path="/v1/predictions", **query):
    with httpx.Client(base_url=service.url, timeout=60, trust_env=False) as client:
        return client.get(path, params=query)


def test_the_event_loop_answers_while_every_worker_is_busy(store, publish, move, question, own_process):
    move(store, publish(store, architecture="paper_network"))
    client, _process = own_process()
    heavy = question | {"horizon_s": 600, "dt_s": 0.00601, "include": "prior", "format": "usda"}
    assert client.get("/v1/predictions", params=heavy).status_code == 200

    alive = 0
    with ThreadPoolExecutor(8) as pool:
        running = [pool.submit(client.get, "/v1/predictions", params=heavy) for _ in range(8)]
        while not all(each.done() for each in running):
            assert client.get("/health/live").status_code == 200
            alive += 1
        answers = [each.result() for each in running]

    assert [answer.status_code for answer in answers] == [200] * 8
    assert len({answer.content for answer in answers}) == 1
    # each takes a hundredth of a prediction, on a slow machine too; behind a blocked loop one or two would fit in each
    assert alive > 5 * len(running)


@pytest.mark.slow
def test_what_would_wait_too_long_is_turned_away(serve, store, publish, move, question):
    move(store, publish(store, architecture="paper_network"))
    service = serve(threads=1, max_waiting=1)
    service.wait_ready()
    heavy = question | {"horizon_s": 600, "dt_s": 0.00601}

    with ThreadPoolExecutor(6) as pool:
        answers = list(pool.map(lambda _: ask(service, **heavy), range(6)))

    statuses = sorted(answer.status_code for answer in answers)
    assert statuses[0] == 200
    assert statuses[-1] == 503
    refused = next(answer for answer in answers if answer.status_code == 503)
    assert refused.json()["type"] == "urn:rover-twin:problem:overloaded"
    assert refused.headers["retry-after"] == "1"
    assert service.predict().status_code == 200


@pytest.mark.slow
def test_a_moved_alias_is_followed_within_two_seconds_and_no_request_fails(
    serve, store, publish, move, question, clock
):
    move(store, publish(store, coefficient=0.1))
    service = serve()
    service.wait_ready()
    seen, wrong, stop = [], [], threading.Event()

    def keep_asking():
        with httpx.Client(base_url=service.url, timeout=60, trust_env=False) as client:
            while not stop.is_set():
                answer = client.get("/v1/predictions", params=question)
                seen.append((clock(), answer.json()["model"]["version"] if answer.is_success else 0))
                if not answer.is_success:
                    wrong.append(answer.text)

    askers = [threading.Thread(target=keep_asking) for _ in range(4)]
    for asker in askers:
        asker.start()
    time.sleep(0.3)
    move(store, publish(store, coefficient=0.2))
    moved = clock()
    clock.wait_until(lambda: clock() > moved + 2.5, 60)
    stop.set()
    for asker in askers:
        asker.join()

    assert wrong == []
    assert {version for _, version in seen} == {1, 2}
    assert all(version == 2 for when, version in seen if when > moved + 2)
    assert any(when > moved + 2 for when, _ in seen)
