"""Steady load on the two APIs: a few clients that ask, note what became of it, wait a little and ask again."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Self

import httpx

from tests.api.conftest import PLAIN
from tests.cluster.machines import APIS, HEADERS, JOBS, QUESTION, Machines

PAUSE_S = 0.2
PATIENCE_S = 10.0
ELSEWHERE = "predictions, with the other API as second choice"
KINDS = ("predictions", "list of jobs", "list of models")
_PATHS = dict(zip(KINDS, ("/v1/predictions", JOBS, "/v1/models"), strict=True))


@dataclass
class Lane:
    """What one client met: when it asked, how long that took, whether it got what it wanted."""

    asked: list[tuple[float, float, bool]] = field(default_factory=list)

    def failures(self) -> int:
        """Requests without a good answer: refused, cut off or longer than the client waits."""
        return sum(not good for _, _, good in self.asked)

    def recovered_at(self) -> float | None:
        """When the last bad answer had come; None without any."""
        return max((at + took for at, took, good in self.asked if not good), default=None)

    def last_good(self, count: int) -> bool:
        """Whether the last `count` requests were answered well."""
        return len(self.asked) >= count and all(good for _, _, good in self.asked[-count:])


class Load:
    """Runs while the block does. `lanes` has what was met, by (API, kind), and under `ELSEWHERE`."""

    def __init__(self, machines: Machines) -> None:
        self._over = threading.Event()
        self._urls = [machines.url(name) for name in APIS]
        self.lanes: dict[tuple[str, str], Lane] = {}
        self._threads = []
        for name, url in zip(APIS, self._urls, strict=True):
            for kind in KINDS:
                self._add((name, kind), [url], _PATHS[kind])
        self._add(("either", ELSEWHERE), self._urls, _PATHS["predictions"])

    def _add(self, key: tuple[str, str], urls: list[str], path: str) -> None:
        lane = self.lanes[key] = Lane()
        self._threads.append(threading.Thread(target=self._ask, args=(lane, urls, path), daemon=True))

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join(2 * PATIENCE_S + 5)

    def all_good(self, count: int = 5) -> bool:
        """Whether every lane's last requests were answered well."""
        return all(lane.last_good(count) for lane in self.lanes.values())

    def of(self, kind: str, *names: str) -> list[Lane]:
        """The lanes of a kind, at these APIs or at all."""
        return [lane for (name, which), lane in self.lanes.items() if which == kind and (not names or name in names)]

    def _ask(self, lane: Lane, urls: list[str], path: str) -> None:
        parameters = QUESTION if path == _PATHS["predictions"] else {"limit": 1} if path == JOBS else {}
        with httpx.Client(headers=HEADERS, timeout=PATIENCE_S, **PLAIN) as client:
            while not self._over.wait(PAUSE_S):
                began = time.monotonic()
                good = any(_good(lambda url=url: client.get(url + path, params=parameters)) for url in urls)
                lane.asked.append((began, time.monotonic() - began, good))


def _good(ask: Callable[[], httpx.Response]) -> bool:
    with suppress(httpx.TransportError):
        return ask().is_success
    return False
