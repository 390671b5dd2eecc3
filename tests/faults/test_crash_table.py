"""A few rounds of the fault table: whatever is killed, nothing acknowledged is lost and nothing is left half done."""

from __future__ import annotations

import importlib.util
import os

import pytest

from tests.faults.crash_table import SHARES, run

pytestmark = pytest.mark.kills

KILLS = 12


@pytest.mark.skipif(not hasattr(os, "fork"), reason="SIGKILL and fork are POSIX")
@pytest.mark.timeout(240)
def test_kills_at_random_moments_lose_nothing_and_leave_nothing():
    engines = tuple(SHARES) if importlib.util.find_spec("pgserver") else ("sqlite",)
    table = run(KILLS, seed=20261122, engines=engines)
    assert table.kills >= KILLS
    assert table.faults == [], table.markdown()
    victims = {victim for victim, _ in table.rows}
    assert victims == {victim for engine in engines for victim in SHARES[engine]}
