"""Replicas that are replaced under load: no request fails, of clients that ask all the time or once in a while."""

from __future__ import annotations

import asyncio

import pytest

from tests.benchmarks.rolling import roll

pytestmark = [pytest.mark.processes, pytest.mark.slow]


def test_no_request_fails_while_replicas_are_replaced() -> None:
    """Twice each; `tests.benchmarks.attacks` does it ten times."""
    seen = asyncio.run(roll(4, clients=8))
    assert seen.failed == []
    assert seen.restarts == 4
    assert seen.answered > 50
