"""Which twins are in memory, and which one an alias means now.

The store says what exists, the registry what is loaded. A thread follows every alias that somebody asked for: when one
moves, the new version is loaded first and takes its place in one step, while requests that hold the old twin finish on
it. When the new one cannot be loaded, the old one stays and the reason is kept for `status`.

Of a remote store one listing tells whether anything has changed since the last look; only then aliases are read.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache

from model_store import ModelStore, Resolved, StoreError, StoreUnavailableError, parse_reference
from service.errors import RoverTwinError
from service.tracing import span
from service.twin.load import load_twin
from service.twin.probe import probe
from service.twin.twin import Twin

_log = logging.getLogger(__name__)
_LOOK_AT_OTHERS_S = 60.0
REFRESH_S, REMOTE_REFRESH_S = 0.5, 4.0
_STALE_S = 4.0  # later than a look was due, aliases count as stale
_CLOSE_S = 0.5
_MAX_FOLLOWED = 64  # aliases in use; the least recently asked for is no longer followed


@dataclass(slots=True)
class Loaded:
    """A twin and the alias it was asked for by, if any. Nobody changes one."""

    twin: Twin
    alias: str | None


@dataclass(frozen=True, slots=True)
class RegistryStatus:
    """What is resident ("name@version") and which references cannot be loaded or refreshed, with the reason.

    `confirmed_s` is how long ago the store last said where all followed aliases point; `stale_since` is that moment
    when the next look is overdue. `failed_looks` counts looks that the store did not answer.
    """

    default_reference: str
    resident: tuple[str, ...]
    failures: tuple[tuple[str, str], ...]
    confirmed_s: float
    stale_since: datetime | None
    failed_looks: int


class TwinRegistry:
    """Twins by reference, at most `capacity` of them resident; thread-safe.

    `refresh_s` is how often followed aliases are looked up in the store. A twin predicts once before it is handed out,
    so that no request waits for what only a first prediction needs. `loaded` is told of each that was brought into
    memory, `released` that some were dropped.
    """

    def __init__(
        self,
        store: ModelStore,
        default_reference: str,
        *,
        capacity: int = 4,
        refresh_s: float = REFRESH_S,
        loaded: Callable[[Twin], None] = lambda _twin: None,
        released: Callable[[], None] = lambda: None,
    ) -> None:
        self._store = store
        self._default = _canonical(default_reference)
        self._capacity = max(1, capacity)
        self._refresh_s = refresh_s
        self._tell_loaded = loaded
        self._released = released
        self._lock = threading.Lock()
        self._loading = threading.Lock()  # one load at a time: a load takes memory and cores
        self._twins: OrderedDict[tuple[str, int], Twin] = OrderedDict()  # least recently used first
        self._followed: OrderedDict[str, Resolved] = OrderedDict()  # least recently asked for first
        self._failures: dict[str, str] = {}
        self._asked: set[tuple[str, int]] = set()  # by number, since it was last looked whether they are retired
        self._looked_at = 0.0
        self._confirmed = time.monotonic()  # when the last look began that the store answered
        self._fingerprint: str | None = None  # of a remote store, as that look found it
        self._moved = -1.0  # when somebody last said `moved`
        self._failed_looks = 0
        self._stop = threading.Event()
        self._look_now = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="alias-follower", daemon=True)

    def start(self) -> None:
        """Load the default model, if it can be, and begin to follow aliases. A default that fails is tried again."""
        self._look()
        if not self._stop.is_set():
            self._thread.start()

    def close(self) -> None:
        """Stop following. Twins already handed out stay usable. A look that hangs is not waited for."""
        self._stop.set()
        self._look_now.set()
        if self._thread.is_alive():
            self._thread.join(_CLOSE_S)

    def moved(self) -> None:
        """Somebody has just changed the store through this process: look at once, and trust no earlier look."""
        with self._lock:
            self._fingerprint = None
            self._moved = time.monotonic()
        self._look_now.set()

    def fingerprint(self) -> str | None:
        """What the last look found in a remote store: as long as it stays, nothing there has changed.

        None for a store on this machine, after `moved`, and when the last look is older than it should be.
        """
        with self._lock:
            return None if self._overdue() else self._fingerprint

    def get(self, reference: str | None = None) -> Loaded:
        """The twin for `name`, `name@3` or `name@alias`; the default model without a reference.

        A resident twin costs a look-up in memory; everything else reads the store. Raises what the store raises,
        and CheckpointError.
        """
        if loaded := self.resident(reference):
            return loaded
        key = _canonical(reference) if reference else self._default
        with self._lock:
            resolved = self._followed.get(key)
        if resolved is None:
            resolved = self._bring_up_to_date(key)
        return Loaded(self._twin(resolved), resolved.alias)

    def resident(self, reference: str | None = None) -> Loaded | None:
        """What `get` returns when that is in memory, else None. Never waits for the store: fit for an event loop.

        Raises InvalidReferenceError.
        """
        key = _canonical(reference) if reference else self._default
        with self._lock:
            resolved = self._followed.get(key)
            if resolved:
                self._followed.move_to_end(key)
            else:
                resolved = _numbered(key)
            twin = self._touched((resolved.name, resolved.version)) if resolved else None
            if resolved and resolved.alias is None and twin:
                self._asked.add((resolved.name, resolved.version))
        return Loaded(twin, resolved.alias) if twin and resolved else None

    def unload(self, name: str) -> None:
        """Drop the versions of a model from memory, but for the default one; what runs on them finishes."""
        with self._loading, self._lock:
            default = self._followed.get(self._default) or _numbered(self._default)
            for key in [key for key in self._followed if key != self._default and parse_reference(key).name == name]:
                del self._followed[key]
            for place in [place for place in self._twins if place[0] == name]:
                if default is None or place != (default.name, default.version):
                    del self._twins[place]
        self._released()

    def status(self) -> RegistryStatus:
        """What is resident and what fails."""
        with self._lock:
            resident = tuple(sorted(f"{name}@{version}" for name, version in self._twins))
            age_s = time.monotonic() - self._confirmed
            since = datetime.now(UTC) - timedelta(seconds=age_s) if self._overdue() else None
            failures = tuple(sorted(self._failures.items()))
            return RegistryStatus(self._default, resident, failures, age_s, since, self._failed_looks)

    def _overdue(self) -> bool:
        return time.monotonic() - self._confirmed > 2 * self._refresh_s + _STALE_S

    def _follow(self) -> None:
        while not self._stop.is_set():
            self._look_now.wait(self._refresh_s)
            self._look_now.clear()
            if not self._stop.is_set():
                self._look()

    def _look(self) -> None:
        """Bring all followed references up to date; nothing is read of a remote store that has not changed."""
        began = time.monotonic()
        with self._lock:
            keys = {*self._followed, self._default}
            known, failing = self._fingerprint, set(self._failures)
        try:
            found = self._store.fingerprint() if self._store.remote else None
        except StoreError as error:
            for key in keys:
                self._note_failure(key, str(error))
            answered = False
        else:
            unchanged = found is not None and found == known
            looked = [self._refresh(key) for key in (keys & failing if unchanged else keys)]
            answered = all(looked) and (unchanged or self._retire(everything=found is not None))
        with self._lock:
            self._failed_looks += not answered
            if answered:
                self._confirmed = began
                self._fingerprint = found if began > self._moved else None

    def _refresh(self, key: str) -> bool:
        """Bring one reference up to date; a failure is kept and logged once, not raised: the old twin serves on.

        Whether the store answered.
        """
        try:
            self._bring_up_to_date(key, followed=key != self._default)
        except StoreUnavailableError as error:
            self._note_failure(key, str(error))
            return False
        except (StoreError, RoverTwinError) as error:
            self._note_failure(key, str(error))
        except Exception as error:  # the follower must outlive whatever a broken store does
            _log.exception("refreshing %s failed", key)
            self._note_failure(key, f"{type(error).__name__}: {error}")
        else:
            with self._lock:
                self._failures.pop(key, None)
        return True

    def _retire(self, *, everything: bool) -> bool:
        """Drop what is retired; whether the store answered. It is tried again at the next look."""
        if everything:
            self._looked_at = -math.inf
        try:
            self._drop_retired()
        except Exception as error:  # as in `_refresh`
            _log.warning("cannot see which versions are retired: %s", error)
            return False
        return True

    def _drop_retired(self) -> None:
        """Drop what was archived or deleted meanwhile, unless an alias that is followed means it, or it is the default.

        Looks after those that were asked for by number at once, after the others once a minute: the store of a service
        that idles is left alone.
        """
        with self._lock:
            default = _numbered(self._default)
            kept = {(each.name, each.version) for each in (*self._followed.values(), *([default] if default else ()))}
            places = self._twins.keys() - kept
            asked, self._asked = self._asked & places, set()
        if time.monotonic() < self._looked_at + _LOOK_AT_OTHERS_S:
            places = asked
        else:
            self._looked_at = time.monotonic()
        gone: set[tuple[str, int]] = set()
        for name in {name for name, _ in places}:
            gone |= {(name, version) for version in self._store.retired(name)} & places
        if gone:
            with self._lock:
                for place in gone:
                    self._twins.pop(place, None)
            _log.info("dropped, for they are retired: %s", ", ".join(f"{name}@{each}" for name, each in sorted(gone)))
            self._released()

    def _note_failure(self, key: str, reason: str) -> None:
        with self._lock:
            known = self._failures.get(key)
            self._failures[key] = reason
        if known != reason:
            _log.warning("cannot load %s: %s", key, reason)

    def _bring_up_to_date(self, key: str, *, followed: bool = False) -> Resolved:
        """Look up what the reference means now; a new version is loaded before it takes its place.

        One that is said to be `followed` and is no longer, since its model was unloaded, stays so.
        """
        if resolved := _numbered(key):  # a number always means the same: nothing to follow
            self._twin(resolved)
            return resolved
        resolved = self._store.resolve(key)
        with self._lock:
            known = self._followed.get(key)
        if known == resolved:
            return known
        if followed and known is None:
            return resolved
        self._twin(resolved)
        with self._lock:
            if followed and key not in self._followed:
                return resolved
            self._followed[key] = resolved
            if len(self._followed) > _MAX_FOLLOWED:
                del self._followed[next(each for each in self._followed if each != self._default)]
        _log.info("%s is now version %d", key, resolved.version)
        return resolved

    def _twin(self, resolved: Resolved) -> Twin:
        """A resident twin, or a newly loaded one."""
        place = resolved.name, resolved.version
        twin = self._resident(place)
        if twin is None:
            with self._loading:
                twin = self._resident(place)
                if twin is None:
                    with span("load model", model=resolved.name, version=resolved.version):
                        twin = load_twin(self._store, *place)
                    self._tell_loaded(twin)
                    _warm_up(twin)
                with self._lock:
                    before = len(self._twins)
                    self._twins[place] = twin
                    self._drop_least_used(keep=place)
                    dropped = len(self._twins) <= before
                if dropped:
                    self._released()
        return twin

    def _resident(self, place: tuple[str, int]) -> Twin | None:
        with self._lock:
            return self._touched(place)

    def _touched(self, place: tuple[str, int]) -> Twin | None:
        """The twin as the most recently used one. Needs the lock."""
        twin = self._twins.get(place)
        if twin is not None:
            self._twins.move_to_end(place)
        return twin

    def _drop_least_used(self, keep: tuple[str, int]) -> None:
        """Drop twins over the capacity, never the default model's nor the one just loaded."""
        default = self._followed.get(self._default)
        kept = {keep, (default.name, default.version) if default else keep}
        for place in [place for place in self._twins if place not in kept]:
            if len(self._twins) <= self._capacity:
                break
            del self._twins[place]


def _warm_up(twin: Twin) -> None:
    try:
        probe(twin)
    except RoverTwinError as error:  # it may answer others; readiness, too, predicts and says what is wrong
        _log.warning("%s@%d does not answer its first question: %s", twin.name, twin.version, error)


@lru_cache(maxsize=1024)
def _numbered(key: str) -> Resolved | None:
    """What a reference with a number means; None for one with an alias."""
    asked = parse_reference(key)
    return None if asked.version is None else Resolved(asked.name, asked.version, None)


@lru_cache(maxsize=1024)
def _canonical(reference: str) -> str:
    """The reference with its default alias spelt out. Raises InvalidReferenceError."""
    asked = parse_reference(reference)
    return f"{asked.name}@{asked.version or asked.alias}"
