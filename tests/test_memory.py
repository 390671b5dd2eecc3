"""What the C library keeps of freed memory, in a process of its own: the settings hold for good."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

pytestmark = pytest.mark.processes

_PROGRAM = """
import threading
import numpy as np
from service.memory import give_back, limit_arenas

def resident_kib():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmRSS"))

if {limited}:
    limit_arenas()
kept = []

def work():
    blocks = [np.ones(12_000) for _ in range(40)]  # 96 kB each: of an arena
    kept.append(blocks[::8])

before = resident_kib()
threads = [threading.Thread(target=work) for _ in range(16)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
if {limited}:
    give_back()
print(resident_kib() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the settings are glibc's")
def test_freed_memory_goes_back():
    kept, given_back = (growth_kib(limited=limited) for limited in (False, True))

    live = 16 * 5 * 96
    assert given_back < live + 4 * 1024
    assert given_back < kept


def growth_kib(*, limited):
    command = [sys.executable, "-c", _PROGRAM.format(limited=limited)]
    return int(subprocess.run(command, check=True, capture_output=True).stdout)
