"""A store that hangs keeps nobody waiting for what is in memory, though every thread that reads it is stuck."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from tests.api.conftest import QUESTION

STORAGE_THREADS = 16
TENSORS = {
    "inputs": [{"name": name, "shape": [1], "datatype": "FP64", "data": [each]} for name, each in QUESTION.items()]
}
FROM_MEMORY = {
    "prediction": ("GET", "/v1/predictions", {"params": QUESTION}),
    "posted prediction": ("POST", "/v1/predictions", {"json": QUESTION}),
    "by a version": ("GET", "/v1/predictions", {"params": QUESTION | {"model": "viper-lunar@champion"}}),
    "batch": ("POST", "/v1/predictions/batch", {"json": {"scenarios": [QUESTION]}}),
    "mobility": ("GET", "/v1/mobility", {"params": {"mass_kg": 430, "torque_min_nm": 60, "slope_steps": 3}}),
    "suggested runs": ("GET", "/v1/models/viper-lunar/versions/1/suggested-runs", {"params": {"n": 1}}),
    "inference": ("POST", "/v2/models/viper-lunar/infer", {"json": TENSORS}),
    "model ready": ("GET", "/v2/models/viper-lunar/ready", {}),
    "server ready": ("GET", "/v2/health/ready", {}),
    "ready": ("GET", "/health/ready", {}),
    "live": ("GET", "/health/live", {}),
    "metrics": ("GET", "/metrics", {}),
}


@pytest.fixture(scope="module")
def hanging(banded):
    """The service `banded` while all its threads for the store read a file that never ends: a pipe nobody writes to."""
    pipe = Path(banded.store.location) / "models" / "hangs" / "versions" / "1" / "manifest.json"
    pipe.parent.mkdir(parents=True)
    os.mkfifo(pipe)

    def read() -> None:
        with suppress(httpx.TransportError):
            httpx.get(f"{banded.url}/v1/models/hangs/versions/1", timeout=300, trust_env=False)

    with ThreadPoolExecutor(STORAGE_THREADS) as pool:
        readers = [pool.submit(read) for _ in range(STORAGE_THREADS)]
        try:
            _until_nobody_reads_the_store(banded.url)
            yield banded
            assert not _reads_the_store(banded.url)  # those who asked were given up, their threads hang as before
        finally:
            while not (all(each.done() for each in readers) and _reads_the_store(banded.url)):
                with suppress(OSError):  # opened and closed again, the pipe is an empty file to who waits for it
                    os.close(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK))
                time.sleep(0.01)
            pipe.unlink()


def _until_nobody_reads_the_store(url: str) -> None:
    for _ in range(100):
        if not _reads_the_store(url):
            return
        time.sleep(0.05)
    raise AssertionError("the store still answers")


def _reads_the_store(url: str) -> bool:
    try:
        answer = httpx.get(f"{url}/v1/models/viper-lunar/aliases", timeout=1, trust_env=False)
    except httpx.ReadTimeout:
        return False
    return answer.is_success


@pytest.mark.slow
@pytest.mark.parametrize("case", FROM_MEMORY)
def test_what_is_in_memory_is_answered(hanging, case):
    method, path, request = FROM_MEMORY[case]

    assert hanging.client.request(method, path, **request).status_code == 200
