"""The program that prints what bad uploads are answered, on a few of them; the other tests try each one."""

from __future__ import annotations

import pytest

from tests.datasets.hostile_files import HOSTILE_FILES
from tests.datasets.hostile_table import BAD_REQUESTS, HEAD, rows


@pytest.mark.processes
def test_each_bad_upload_gets_the_answer_that_is_due():
    made = list(rows(HOSTILE_FILES[::50], BAD_REQUESTS))
    assert [row.name for row in made if row.wrong] == []
    assert all(row.reason for row in made)
    assert all(row.markdown().count(" | ") == HEAD.splitlines()[0].count(" | ") for row in made)
