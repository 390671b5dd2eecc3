"""What is counted while requests are answered, for Prometheus. Times are seconds, routes are templates.

Several server processes share one view: each writes its numbers to a file in a common folder (prometheus-client's
multiprocess mode), and whichever is asked adds them up.
"""

from __future__ import annotations

import os
from bisect import bisect_left
from collections.abc import Sequence
from typing import Any, Self

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    PlatformCollector,
    ProcessCollector,
    disable_created_metrics,
    values,
)
from prometheus_client.exposition import choose_encoder
from prometheus_client.multiprocess import MultiProcessCollector
from prometheus_client.registry import Collector
from prometheus_client.values import MultiProcessValue

from service.twin import Twin
from service.twin.drives import DriveOutcome
from service.twin.summary import Outcome

PREFIX = "rover_twin_"
_MOST_VERSIONS = 64  # told apart; later ones are counted together, so that a long life cannot fill the memory
_OTHER = "other"
_METHODS = frozenset({"GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH"})
# bounds that OpenTelemetry advises for HTTP, and finer ones: an answer takes milliseconds
_REQUEST_BOUNDS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.075, 0.1, 0.25, 0.5, 0.75, 1, 2.5, 5, 7.5, 10)
_COMPUTE_BOUNDS_S = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5)
_STEP_BOUNDS_S = (0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1)
_VERSION = ("model_name", "model_version")


class SeriesOfTimes:
    """One series of a histogram: counts in it as `observe` does, without asking each time whether it is one."""

    def __init__(self, series: Histogram) -> None:
        self._sum, self._bounds, self._buckets = series._sum, series._upper_bounds, series._buckets

    def observe(self, seconds: float) -> None:
        """Counts a time."""
        self._sum.inc(seconds)
        self._buckets[bisect_left(self._bounds, seconds)].inc(1)


class Instruments:
    """Counters of one service. `folder` is where several processes put theirs; None for a service of one process.

    Thread-safe. A process of several gets its own by `shared`.
    """

    def __init__(self, folder: str | None = None) -> None:
        # a second series for each, which several processes do not have
        disable_created_metrics()  # type: ignore[no-untyped-call]
        self._folder = folder
        self._own = own = CollectorRegistry(auto_describe=True)
        if folder is None:
            ProcessCollector(registry=own)
            PlatformCollector(registry=own)
        self._versions: dict[tuple[str, int], tuple[str, str]] = {}
        self._answered: dict[tuple[str, str, int], tuple[Any, SeriesOfTimes]] = {}
        self._computed: dict[tuple[str, str], tuple[SeriesOfTimes, dict[str, Any]]] = {}
        self._driven: dict[tuple[str, str], tuple[Histogram, dict[DriveOutcome, Counter]]] = {}
        self._requests = Counter(
            f"{PREFIX}http_requests", "Answered requests.", ("method", "route", "status"), registry=own
        )
        self._seconds = Histogram(
            f"{PREFIX}http_request_duration_seconds",
            "From the first byte of a request to the last of its answer.",
            ("method", "route"),
            buckets=_REQUEST_BOUNDS_S,
            registry=own,
        )
        self._running = Gauge(
            f"{PREFIX}http_requests_in_progress", "Running requests.", registry=own, multiprocess_mode="livesum"
        )
        self._processes = Gauge(
            f"{PREFIX}server_processes", "Processes that answer requests.", registry=own, multiprocess_mode="livesum"
        )
        self._scenarios = Counter(f"{PREFIX}predictions", "Predicted scenarios.", (*_VERSION, "outcome"), registry=own)
        self._outside = Counter(
            f"{PREFIX}predictions_outside_domain",
            "Predicted scenarios outside the domain of the version that answered.",
            _VERSION,
            registry=own,
        )
        self._compute = Histogram(
            f"{PREFIX}prediction_duration_seconds",
            "Arithmetic of one call, of a single scenario or a batch.",
            _VERSION,
            buckets=_COMPUTE_BOUNDS_S,
            registry=own,
        )
        self._steps = Counter(f"{PREFIX}steps", "Steps of rovers.", ("route", "result"), registry=own)
        self._step_seconds = Histogram(
            f"{PREFIX}step_duration_seconds",
            "Arithmetic of the steps of one message.",
            ("route",),
            buckets=_STEP_BOUNDS_S,
            registry=own,
        )
        self._live = Gauge(
            f"{PREFIX}live_connections", "Open connections to /v1/live.", registry=own, multiprocess_mode="livesum"
        )
        self._live_rovers = Gauge(
            f"{PREFIX}live_rovers", "Rovers of open connections.", registry=own, multiprocess_mode="livesum"
        )
        self._live_ended = Counter(
            f"{PREFIX}live_connections_ended", "Connections to /v1/live that are over.", ("reason",), registry=own
        )
        self._live.set(0)
        self._live_rovers.set(0)
        self._stepped: dict[str, tuple[Counter, Counter, Histogram]] = {}
        self._drives = Counter(f"{PREFIX}drives", "Answered drives.", (*_VERSION, "outcome"), registry=own)
        self._drives_outside = Counter(
            f"{PREFIX}drives_outside_domain",
            "Answered drives that leave the domain of the version that answered.",
            _VERSION,
            registry=own,
        )
        self._driving = Histogram(
            f"{PREFIX}drive_duration_seconds",
            "Arithmetic of one drive.",
            _VERSION,
            buckets=_COMPUTE_BOUNDS_S,
            registry=own,
        )
        self._loads = Counter(f"{PREFIX}model_loads", "Versions brought into memory.", _VERSION, registry=own)
        self._refused = Counter(
            f"{PREFIX}connections_refused",
            "Connections that were cut off, or refused before there was a request.",
            ("reason",),
            registry=own,
        )
        self._logins = Counter(
            f"{PREFIX}failed_logins", "Requests with a token that did not let them in.", ("reason",), registry=own
        )
        self._processes.set(1)
        self._running.set(0)
        self._open = self._running._value  # the series itself, as in `SeriesOfTimes`

    @classmethod
    def shared(cls, folder: str, index: int) -> Self:
        """Those of process number `index` of several. One that takes the place of a dead one goes on with its files.

        From here on, everything in this process that counts with prometheus-client does it in `folder`.
        """
        os.environ["PROMETHEUS_MULTIPROC_DIR"] = folder
        # what its documentation does for uWSGI
        values.ValueClass = MultiProcessValue(process_identifier=lambda: index)  # type: ignore[no-untyped-call]
        return cls(folder)

    def begun(self) -> None:
        """A request came in that may have to wait."""
        self._open.inc(1)

    def over(self) -> None:
        """It waits no longer."""
        self._open.inc(-1)

    def ended(self, method: str, route: str, status: int, seconds: float) -> None:
        """A request was answered; `route` is a template. Status 0: its answer was cut off before it began."""
        method = method if method in _METHODS else _OTHER
        # found once: prometheus-client takes longer to find a series than to count in it
        place = method, route, status
        series = self._answered.get(place)
        if series is None:
            requests, durations = self._requests.labels(method, route, str(status)), self._seconds.labels(method, route)
            series = self._answered[place] = requests._value, SeriesOfTimes(durations)
        series[0].inc(1)
        series[1].observe(seconds)

    def refused(self, reason: str) -> None:
        """A connection was cut off or refused; `reason` is one of few words."""
        self._refused.labels(reason).inc()

    def login_failed(self, reason: str) -> None:
        """A token was wrong, wrong and too early (slowed), or of too small a scope."""
        self._logins.labels(reason).inc()

    def loaded(self, twin: Twin) -> None:
        """A version was brought into memory."""
        self._loads.labels(*self._labels(twin)).inc()

    def predicted(self, twin: Twin, seconds: float, outcomes: Sequence[Outcome], outside: int) -> None:
        """Scenarios were predicted in so many seconds, of which so many are outside the domain."""
        labels = self._labels(twin)
        compute, by_outcome = self._computed.get(labels) or self._series_of(labels)
        compute.observe(seconds)
        if len(outcomes) == 1:
            by_outcome[outcomes[0]._value_].inc(1)  # members of enumerations are slow keys
        else:
            for outcome in set(outcomes):
                by_outcome[outcome._value_].inc(outcomes.count(outcome))
        if outside:
            self._outside.labels(*labels).inc(outside)

    def stepped(self, route: str, rovers: int, refused: int, seconds: float) -> None:
        """Rovers were moved on, and others refused, for one message that took so many seconds."""
        series = self._stepped.get(route)
        if series is None:
            counters = (self._steps.labels(route, "moved"), self._steps.labels(route, "refused"))
            series = self._stepped[route] = (*counters, self._step_seconds.labels(route))
        series[0].inc(rovers)
        if refused:
            series[1].inc(refused)
        series[2].observe(seconds)

    def live_connections(self, more: int) -> None:
        """So many more connections are open."""
        self._live.inc(more)

    def live_rovers(self, more: int) -> None:
        """So many more rovers are kept."""
        self._live_rovers.inc(more)

    def live_ended(self, reason: str) -> None:
        """A connection is over, or was refused."""
        self._live_ended.labels(reason).inc()

    def drove(self, twin: Twin, seconds: float, outcome: DriveOutcome, inside: bool) -> None:
        """A drive was answered in so many seconds."""
        labels = self._labels(twin)
        series = self._driven.get(labels)
        if series is None:
            by_outcome = {each: self._drives.labels(*labels, each.value) for each in DriveOutcome}
            series = self._driven[labels] = self._driving.labels(*labels), by_outcome
        series[0].observe(seconds)
        series[1][outcome].inc()
        if not inside:
            self._drives_outside.labels(*labels).inc()

    def _series_of(self, labels: tuple[str, str]) -> tuple[SeriesOfTimes, dict[str, Any]]:
        by_outcome = {each.value: self._scenarios.labels(*labels, each.value)._value for each in Outcome}
        series = self._computed[labels] = SeriesOfTimes(self._compute.labels(*labels)), by_outcome
        return series

    def exposition(self, accept: str = "", *others: Collector) -> tuple[str, bytes]:
        """Media type and text of everything counted so far, by all processes, and of what `others` know."""
        everything = CollectorRegistry()
        if self._folder is None:
            everything.register(self._own)
        else:
            MultiProcessCollector(everything, path=self._folder)  # type: ignore[no-untyped-call]
        for each in others:
            everything.register(each)
        encode, media_type = choose_encoder(accept)
        return media_type, encode(everything)

    def _labels(self, twin: Twin) -> tuple[str, str]:
        place = twin.name, twin.version
        known = self._versions.get(place)
        if known is None:
            if len(self._versions) >= _MOST_VERSIONS:
                return _OTHER, _OTHER
            known = self._versions[place] = (twin.name, str(twin.version))
        return known
