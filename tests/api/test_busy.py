"""Work that takes seconds, asked for by many who do not wait: others are served, and probes are answered."""

from __future__ import annotations

import asyncio
import contextlib
import time
from typing import Any

import httpx
import pytest

from tests.clients.test_driving import free_port, serving

pytestmark = [pytest.mark.processes, pytest.mark.slow]

SUGGESTIONS = "/v1/models/viper-lunar/versions/5/suggested-runs?n=64"
CALLS = "rover_twin_prediction_duration_seconds_count"
PREDICTION = "/v1/predictions?slope_deg=20&mass_kg=430&torque_nm=60"


@pytest.fixture
def url(tmp_path: Any) -> Any:
    port = free_port()
    with serving(tmp_path, port):
        yield f"http://127.0.0.1:{port}"


def test_suggestions_are_computed_once_and_nobody_else_waits(url: str) -> None:
    async def impatient(client: httpx.AsyncClient) -> None:
        with contextlib.suppress(httpx.TimeoutException):
            await client.get(SUGGESTIONS, timeout=0.5)

    async def attack() -> tuple[list[int], list[int]]:
        limits = httpx.Limits(max_connections=None, max_keepalive_connections=0)
        async with httpx.AsyncClient(base_url=url, trust_env=False, limits=limits, timeout=10) as client:
            attackers = [asyncio.create_task(impatient(client)) for _ in range(24)]
            ready, predicted = [], []
            for _ in range(12):
                ready.append((await client.get("/health/ready")).status_code)
                predicted.append((await client.get(PREDICTION)).status_code)
                await asyncio.sleep(0.1)
            await asyncio.gather(*attackers)
            return ready, predicted

    ready, predicted = asyncio.run(attack())
    assert set(ready) == {200}
    assert set(predicted) == {200}
    with httpx.Client(base_url=url, trust_env=False, timeout=60) as client:
        first = client.get(SUGGESTIONS)
        began = time.monotonic()
        again = client.get(SUGGESTIONS.replace("64", "8"))
        took = time.monotonic() - began
    assert first.status_code == again.status_code == 200
    assert again.json()["runs"] == first.json()["runs"][:8]
    assert took < 1.0  # it takes seconds to compute: this one was not


def test_maps_of_clients_that_went_away_are_not_computed(url: str) -> None:
    path = "/v1/mobility?mass_kg={mass}&torque_min_nm=30&torque_max_nm=120&torque_steps=64&slope_steps=64"
    waiting = 12

    async def attack() -> int:
        """Count of maps that were computed for `waiting` clients, each of which leaves after the time of one map."""
        async with httpx.AsyncClient(base_url=url, trust_env=False, timeout=120) as client:
            assert (await client.get(path.format(mass=430))).status_code == 200  # loads the version
            began = time.monotonic()
            assert (await client.get(path.format(mass=431))).status_code == 200
            one_s = time.monotonic() - began
            before = await computed(client)
            masses = range(440, 440 + waiting)
            asks = (client.get(path.format(mass=mass), timeout=one_s) for mass in masses)
            await asyncio.gather(*asks, return_exceptions=True)
            assert (await client.get(path.format(mass=432))).status_code == 200  # the last in the queue
            return await computed(client) - before - 1

    # two are computed at a time: those that had begun when their clients left are finished, and a few before
    assert asyncio.run(attack()) <= waiting / 2


async def computed(client: httpx.AsyncClient) -> int:
    """Calls of the arithmetic so far, a map being one."""
    lines = (await client.get("/metrics")).text.splitlines()
    return sum(int(float(line.split()[-1])) for line in lines if line.startswith(CALLS))
