"""The clock of the timing tests: a stall hardly counts, what the machine had time for does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fair_clock import fair_clock

_SAYS_BOTH = """
import time
from tests.fair_clock import fair_clock
with fair_clock() as clock:
    began = time.monotonic()
    print("begun", flush=True)
    input()
    print(time.monotonic() - began, clock())
"""


@pytest.mark.slow
def test_time_that_passes_is_counted():
    began = time.monotonic()
    with fair_clock() as clock:
        while clock() < 0.3:
            time.sleep(0.02)
            assert time.monotonic() - began < 60, "the clock stands still"
        assert clock() <= time.monotonic() - began + 0.05


@pytest.mark.processes
def test_a_stall_counts_as_one_tick():
    command = [sys.executable, "-c", _SAYS_BOTH]
    root = Path(__file__).parents[1]
    with subprocess.Popen(command, cwd=root, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(1.0)
        os.kill(process.pid, signal.SIGCONT)
        wall, fair = map(float, process.communicate("\n", timeout=60)[0].split())
    assert wall >= 0.9
    assert fair <= wall - 0.8
