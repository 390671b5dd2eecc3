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


_KEEPING = """
import gc
import numpy as np
import pyarrow
from service.memory import Excess, settle

def resident_kib():
    return next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmRSS"))

pyarrow.array([1.0]).cast("float32")  # loads what casts
excess, before = Excess(), resident_kib()
for _ in range(3):
    blocks = [np.ones(12_000) for _ in range(2_000)]  # 192 MB
    tables = [pyarrow.array(np.arange(12_000.0) + row).cast("float32") for row in range(500)]
    del blocks, tables
    freed = resident_kib() - before
    excess.look()
settle()
print(freed, resident_kib() - before)
print(pyarrow.default_memory_pool().backend_name, gc.get_freeze_count(), gc.get_threshold()[0])
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="the settings are glibc's")
def test_what_is_kept_of_freed_memory_is_bounded_without_being_asked_for():
    limited = "from service.memory import limit_arenas; limit_arenas()\n"
    done = subprocess.run([sys.executable, "-c", limited + _KEEPING], check=True, capture_output=True, text=True)
    freed_kib, kept_kib, pool, frozen, threshold = done.stdout.split()
    assert int(freed_kib) > 100 * 1024  # one small block holds all that lies before it
    assert int(kept_kib) < (32 + 16) * 1024
    assert pool == "system"
    assert int(frozen) > 10_000
    assert int(threshold) == 5_000


def growth_kib(*, limited):
    command = [sys.executable, "-c", _PROGRAM.format(limited=limited)]
    return int(subprocess.run(command, check=True, capture_output=True).stdout)
