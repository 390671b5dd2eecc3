"""How long the Python client takes for many predictions: `python -m tests.benchmarks.client_fan_out`.

A service of its own with the shipped model on this machine; both share its processors.
"""

from __future__ import annotations

import asyncio
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from rover_twin_client import AsyncRoverTwin, RoverTwin
from tests.clients.served import served

SINGLE, MANY, THREADS = 1_000, 10_000, 64


async def _gathered(url: str) -> int:
    async with AsyncRoverTwin(url) as twin:
        asked = (twin.predict(slope, 430, 60) for slope in np.linspace(-5, 32, SINGLE))
        answers = await asyncio.gather(*asked, return_exceptions=True)
    return sum(isinstance(answer, BaseException) for answer in answers)


def _threads(url: str) -> int:
    with RoverTwin(url) as twin, ThreadPoolExecutor(THREADS) as pool:
        asked = [pool.submit(twin.predict, slope, 430, 60) for slope in np.linspace(-5, 32, SINGLE)]
        return sum(each.exception() is not None for each in asked)


def _batch(url: str) -> int:
    with RoverTwin(url) as twin:
        return len(twin.predict_batch(slope_deg=np.linspace(-5, 32, MANY), mass_kg=430, torque_nm=60).failures)


def main() -> None:
    """Prints seconds of wall clock, of this process's processor, and how many failed."""
    kinds: dict[str, Callable[[str], int]] = {
        f"{SINGLE:,} by asyncio.gather": lambda url: asyncio.run(_gathered(url)),
        f"{SINGLE:,} by {THREADS} threads": _threads,
        f"{MANY:,} by predict_batch": _batch,
    }
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "log.txt") as url:
        for name, ask in kinds.items():
            began, worked = time.perf_counter(), time.process_time()
            failed = ask(url)
            wall_s, client_s = time.perf_counter() - began, time.process_time() - worked
            print(f"{name}: {wall_s:.1f} s, {client_s:.1f} s of it the client's processor, {failed} failed")


if __name__ == "__main__":
    main()
