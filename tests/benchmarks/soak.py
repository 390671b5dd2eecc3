"""Whether memory stays: `python -m tests.benchmarks.soak`; the whole of it with `--requests 100000 --swaps 1000`.

Requests of every kind, several at once, while the champion moves between versions: two copies of the shipped model,
and now and then a network. Only one version may stay in memory, so each move loads one and drops one.
"""

from __future__ import annotations

import argparse
import itertools
import os
import shutil
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from model_store import ManifestDraft, ModelStore
from tests.benchmarks.client import Question
from tests.benchmarks.machine import CLIENT_CPU, described
from tests.benchmarks.mixture import Mixture
from tests.benchmarks.processes import Running, service
from tests.benchmarks.report import Bar, bars_table, table, write_part

NAME = "viper-lunar"
CONNECTIONS = 4
MOST_MIB, MOST_GROWTH = 250, 1.05
_WARM_REQUESTS, _WARM_SWAPS = 4000, 40
_SETTINGS = {"REFRESH_S": "0.05", "MAX_RESIDENT_VERSIONS": "1"}
_STEPS = 10


class Swapper:
    """Moves the champion, and waits until the service has followed."""

    def __init__(self, running: Running, store: ModelStore, versions: list[int]) -> None:
        self._running, self._store = running, store
        self._next = itertools.cycle(versions)
        self._probe = Question("GET", "/v1/predictions?slope_deg=10&mass_kg=430&torque_nm=60&dt_s=5")

    def swap(self) -> None:
        """One move. Raises TimeoutError when nobody follows."""
        version = next(self._next)
        self._store.move_alias(NAME, "champion", version, actor="soak", reason="soak")
        ends = time.perf_counter() + 60
        with self._running.connect() as connection:
            while connection.ask(self._probe).headers["rover-twin-model"] != f"{NAME}@{version}":
                if time.perf_counter() > ends:
                    raise TimeoutError(f"the service does not follow to {version}")
                time.sleep(0.01)


class Soak:
    """Requests and swaps side by side."""

    def __init__(self, running: Running, swapper: Swapper) -> None:
        self._running, self._swapper = running, swapper
        self._lock = threading.Lock()
        self._seeds = itertools.count()

    def run(self, requests: int, swaps: int) -> None:
        """So many of each, the swaps spread evenly. Raises what any of them raises."""
        left, failed = itertools.count(), threading.Event()
        self._done = 0
        with ThreadPoolExecutor(CONNECTIONS) as pool:
            asking = [pool.submit(self._ask, left, requests, failed) for _ in range(CONNECTIONS)]
            try:
                for swap in range(swaps):
                    while self._done < requests * swap / swaps and not failed.is_set():
                        time.sleep(0.005)
                    self._swapper.swap()
            except BaseException:
                failed.set()
                raise
            for each in asking:
                each.result()

    def _ask(self, left: itertools.count[int], requests: int, failed: threading.Event) -> None:
        with self._lock:
            mixture = Mixture(next(self._seeds))
        try:
            with self._running.connect() as connection:
                while next(left) < requests and not failed.is_set():
                    question, expected = mixture.next()
                    connection.ask(question, *expected)
                    with self._lock:
                        self._done += 1
        except BaseException:
            failed.set()
            raise


def main() -> None:
    """Soak, print, and keep the page."""
    asked = _arguments()
    os.sched_setaffinity(0, {CLIENT_CPU})
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        store = _copied_store(Path(folder))
        with service(folder, _SETTINGS) as running:
            soak = Soak(running, Swapper(running, store, _tour(store)))
            rows: list[list[object]] = [["ready", 0, 0, running.resident_mib()]]
            soak.run(_WARM_REQUESTS, _WARM_SWAPS)
            rows.append(["warm", _WARM_REQUESTS, _WARM_SWAPS, first := _settled(running)])
            print(rows[-1], flush=True)
            for step in range(1, _STEPS + 1):
                soak.run(asked.requests // _STEPS, asked.swaps // _STEPS)
                share = step / _STEPS
                rows.append(
                    [f"{share:.0%}", int(asked.requests * share), int(asked.swaps * share), last := _settled(running)]
                )
                print(rows[-1], flush=True)
    minutes = (time.perf_counter() - began) / 60
    asked_for = f"{asked.requests:,} mixed requests and {asked.swaps:,} swaps"
    bars = [
        Bar(f"resident memory after {asked_for}, MiB", last, MOST_MIB),
        Bar("the same, over warm", last / first, MOST_GROWTH),
    ]
    markdown = (
        f"## Memory\n\n`python -m tests.benchmarks.soak --requests {asked.requests} --swaps {asked.swaps}` "
        f"({minutes:.0f} min). {described()}\n\nRequests of every kind, {CONNECTIONS} at once, with random scenarios, "
        "horizons and forms, while the champion moves; with one resident version each move loads one and drops one.\n\n"
        f"{bars_table(bars)}\n\n{table(('when', 'requests', 'swaps', 'resident MiB'), rows)}"
    )
    print(f"\n{markdown}")
    if not asked.no_page:
        write_part("memory", markdown)


def _settled(running: Running) -> float:
    time.sleep(1.0)
    return running.resident_mib()


def _copied_store(folder: Path) -> ModelStore:
    """The shipped models, and the champion once more under a number of its own."""
    from service.settings import load_settings

    shutil.copytree(Path(load_settings().store_url) / "models", folder / "models")
    store = ModelStore.open(folder)
    champion = store.manifest(NAME, store.resolve(NAME).version)
    files = {file: store.read_file(champion, file) for file in champion.files}
    kept = {name: getattr(champion, name) for name in ManifestDraft.model_fields}
    store.publish(NAME, files, ManifestDraft(**kept))
    return store


def _tour(store: ModelStore) -> list[int]:
    """The two copies in turn, and every twentieth time the oldest version, a network."""
    oldest, *_, champion, copy = store.versions(NAME)
    return [copy, champion] * 9 + [copy, oldest]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--requests", type=int, default=10_000, help="default: 10000")
    parser.add_argument("--swaps", type=int, default=100, help="default: 100")
    parser.add_argument("--no-page", action="store_true", help="print only, keep docs/performance.md as it is")
    return parser.parse_args()


if __name__ == "__main__":
    main()
