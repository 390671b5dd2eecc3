"""A few rounds of the fault table: whatever is killed, nothing acknowledged is lost and nothing is left half done."""

from __future__ import annotations

import importlib.util
import os

import pytest

from tests.faults.crash_table import SHARES, run

pytestmark = pytest.mark.kills

KILLS = {"sqlite": 5, "postgresql": 7}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="SIGKILL and fork are POSIX")
@pytest.mark.parametrize("engine", SHARES)
def test_kills_at_random_moments_lose_nothing_and_leave_nothing(engine):
    if engine == "postgresql" and importlib.util.find_spec("pgserver") is None:
        pytest.skip("no PostgreSQL server to start: pgserver is not installed")
    table = run(KILLS[engine], seed=20261122, engines=(engine,))
    assert table.kills >= KILLS[engine]
    assert table.faults == [], table.markdown()
    assert {victim for victim, _ in table.rows} == set(SHARES[engine])
