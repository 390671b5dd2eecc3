"""What was inferred since the start of this process, by version: Triton's statistics extension."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

_MAX_VERSIONS = 256  # counted at once; the least recently used one is forgotten
PARTS = ("queue", "compute_input", "compute_infer", "compute_output")
_KINDS = ("success", "fail", *PARTS, "cache_hit")


@dataclass(slots=True)
class _Duration:
    count: int = 0
    ns: int = 0

    def add(self, ns: int) -> None:
        self.count += 1
        self.ns += ns


@dataclass(slots=True)
class _Counters:
    last_inference_ms: int = 0
    inferences: int = 0
    executions: int = 0
    durations: dict[str, _Duration] = field(default_factory=lambda: {kind: _Duration() for kind in _KINDS})


class Statistics:
    """Counters of each version; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counters: OrderedDict[tuple[str, int], _Counters] = OrderedDict()

    def succeeded(self, name: str, version: int, scenarios: int, parts_ns: Mapping[str, int]) -> None:
        """Count an answered request of so many scenarios; `parts_ns` has the nanoseconds of each of `PARTS`."""
        with self._lock:
            counters = self._of(name, version)
            counters.last_inference_ms = time.time_ns() // 1_000_000
            counters.inferences += scenarios
            counters.executions += 1
            counters.durations["success"].add(sum(parts_ns.values()))
            for part in PARTS:
                counters.durations[part].add(parts_ns[part])

    def failed(self, name: str, version: int, ns: int) -> None:
        """Count a request that ended in an error after so many nanoseconds."""
        with self._lock:
            self._of(name, version).durations["fail"].add(ns)

    def documents(self, name: str | None = None, version: int | None = None) -> list[dict[str, Any]]:
        """The statistics as the protocol shows them: of all versions that were asked, of one model's, or of one."""
        with self._lock:
            return [
                _document(*place, counters)
                for place, counters in sorted(self._counters.items())
                if name in (None, place[0]) and version in (None, place[1])
            ] or ([] if name is None or version is None else [_document(name, version, _Counters())])

    def _of(self, name: str, version: int) -> _Counters:
        place = name, version
        counters = self._counters.get(place)
        if counters is None:
            counters = self._counters[place] = _Counters()
            if len(self._counters) > _MAX_VERSIONS:
                self._counters.popitem(last=False)
        self._counters.move_to_end(place)
        return counters


def _document(name: str, version: int, counters: _Counters) -> dict[str, Any]:
    return {
        "name": name,
        "version": str(version),
        "last_inference": counters.last_inference_ms,
        "inference_count": counters.inferences,
        "execution_count": counters.executions,
        "inference_stats": {kind: {"count": each.count, "ns": each.ns} for kind, each in counters.durations.items()},
        "batch_stats": [],
    }
