"""A few rounds of the table of bad states: deleted, hanging, frozen or full, nothing acknowledged is lost."""

from __future__ import annotations

import importlib.util
import os

import pytest

from tests.faults.state_table import STATES, run

pytestmark = pytest.mark.kills

ROUNDS = 1


@pytest.mark.skipif(not hasattr(os, "fork"), reason="SIGKILL and fork are POSIX")
@pytest.mark.parametrize("state", STATES)
def test_what_is_acknowledged_in_a_bad_state_is_there_after_it(state):
    if state == "PostgreSQL frozen" and importlib.util.find_spec("pgserver") is None:
        pytest.skip("no PostgreSQL server to start: pgserver is not installed")
    table = run(ROUNDS, seed=20261128, states=(state,))
    assert table.faults == [], table.markdown()
    assert sum(row.rounds for row in table.rows.values()) == ROUNDS
    assert sum(row.told.total() for row in table.rows.values()) == 4 * ROUNDS
