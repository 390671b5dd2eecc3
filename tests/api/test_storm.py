"""Clients that ask again as soon as they are refused: those who are served get about as much as without them."""

from __future__ import annotations

from typing import Any

import pytest

from tests.benchmarks import attackers
from tests.benchmarks.attacks import LARGE
from tests.benchmarks.processes import service

pytestmark = [pytest.mark.processes, pytest.mark.slow]


@pytest.fixture(scope="module")
def server() -> Any:
    with service(settings={"MAX_WAITING": "16"}) as running:
        yield running


def test_a_storm_of_refused_clients_leaves_time_for_the_others(server: Any) -> None:
    """Before refusals had to wait the rate of 400 such clients was a tenth. A loose bound: machines differ."""
    few, many = 0, 0
    for _ in range(2):
        few = max(few, attackers.storm(server, 8, 3, LARGE)[200])
        found = attackers.storm(server, 400, 3, LARGE)
        many = max(many, found[200])
        assert found[503]
        assert set(found) <= {200, 503}
    assert many > 0.4 * few


def test_a_newcomer_is_served_while_two_hundred_never_pause(server: Any) -> None:
    with attackers.silent(server, 200) as busy:
        request = f"GET {LARGE} HTTP/1.1\r\nHost: a\r\n\r\n".encode()
        for each in busy:
            each.sendall(request)
        status, _ = attackers.asked(server, "/health/live", 10)
        assert status == 200
