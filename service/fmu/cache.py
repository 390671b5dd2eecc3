"""FMUs that were made lately: a version never changes, and neither does its FMU."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable

from model_store import Manifest
from service.fmu.archive import Fmi, fmu_bytes, tag_of
from service.twin import Twin

_KEPT = 8


class FmuCache:
    """At most `kept` archives, the least recently asked for go first. Safe to share by threads."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._kept = kept
        self._lock = threading.Lock()
        self._made: OrderedDict[str, bytes] = OrderedDict()

    def known(self, manifest: Manifest, fmi: Fmi) -> bytes | None:
        """The archive if it is kept."""
        tag = tag_of(manifest, fmi)
        with self._lock:
            if tag in self._made:
                self._made.move_to_end(tag)
            return self._made.get(tag)

    def get(self, manifest: Manifest, fmi: Fmi, load: Callable[[], Twin]) -> bytes:
        """The archive, made if it is not kept. Raises what `fmu_bytes` and `load` raise."""
        if found := self.known(manifest, fmi):
            return found
        made = fmu_bytes(load(), fmi)
        with self._lock:
            self._made[tag_of(manifest, fmi)] = made
            while len(self._made) > self._kept:
                self._made.popitem(last=False)
        return made
