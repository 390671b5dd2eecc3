"""FMUs that were made lately: a version never changes, and neither does its FMU."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable

_KEPT = 8


class FmuCache:
    """At most `kept` archives by their `tag_of`, the least recently asked for go first. Safe to share by threads."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._kept = kept
        self._lock = threading.Lock()
        self._made: OrderedDict[str, bytes] = OrderedDict()

    def known(self, tag: str) -> bytes | None:
        """The archive of this tag if it is kept."""
        with self._lock:
            if tag in self._made:
                self._made.move_to_end(tag)
            return self._made.get(tag)

    def get(self, tag: str, make: Callable[[], bytes]) -> bytes:
        """The archive of this tag, made if it is not kept. Raises what `make` raises."""
        if found := self.known(tag):
            return found
        made = make()
        with self._lock:
            self._made[tag] = made
            while len(self._made) > self._kept:
                self._made.popitem(last=False)
        return made
