"""`GET /metrics`: what happens here, for Prometheus. It names no path and no person.

So it needs a token only where everything does (`ROVER_TWIN_REQUIRE_TOKEN`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import anyio.to_thread
from fastapi import Request, Response
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from service.api.http.instruments import PREFIX
from service.api.http.limits.worker_threads import OverloadedError
from service.api.http.openapi import problem_responses
from service.api.http.reading import Route
from service.api.http.router import Router
from service.api.services import Services, TheServices
from service.errors import JobsUnavailableError

_PATIENCE_S = 3.0


class _JobStates(Collector):
    """Training jobs by state; the database counts them, not this process."""

    def __init__(self, counts: Mapping[str, int]) -> None:
        self._counts = counts

    def collect(self) -> Iterable[Metric]:
        """One gauge."""
        jobs = GaugeMetricFamily(f"{PREFIX}training_jobs", "Training jobs by state.", labels=("state",))
        for state, count in self._counts.items():
            jobs.add_metric((state,), count)
        yield jobs


class _Residents(Collector):
    """What the process that was asked has in memory; all processes load what is asked of them."""

    def __init__(self, services: Services) -> None:
        self._status = services.registry.status()
        self._tokens = services.access.tokens

    def collect(self) -> Iterable[Metric]:
        """What is in memory, and how well it follows the store."""
        yield GaugeMetricFamily(f"{PREFIX}resident_versions", "Versions in memory.", len(self._status.resident))
        failures = "References that cannot be loaded or brought up to date."
        yield GaugeMetricFamily(f"{PREFIX}reference_failures", failures, len(self._status.failures))
        age = "Seconds since the store last said where the followed aliases point."
        yield GaugeMetricFamily(f"{PREFIX}aliases_confirmed_age_seconds", age, self._status.confirmed_s)
        looks = CounterMetricFamily(
            f"{PREFIX}alias_looks_failed", "Looks at the aliases that the store did not answer."
        )
        looks.add_metric((), self._status.failed_looks)
        yield looks
        unusable = "Whether the tokens file has become unusable; the tokens before are in force."
        yield GaugeMetricFamily(f"{PREFIX}tokens_file_unusable", unusable, int(self._tokens.problem is not None))
        confirmed = "Seconds since the tokens in force were last found to be those of the file."
        age_s = self._tokens.confirmed_s
        yield GaugeMetricFamily(f"{PREFIX}tokens_file_confirmed_age_seconds", confirmed, age_s)


router = Router(tags=["health"], route_class=Route)


@router.get(
    "/metrics",
    summary="Metrics for Prometheus",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}, **problem_responses()},
)
async def get_metrics(request: Request, services: TheServices) -> Response:
    """Counters since the start, of all processes that share this port. OpenMetrics if the client accepts it."""
    others: list[Collector] = [_Residents(services)]
    if services.jobs is not None and (counts := await _job_counts(services)) is not None:
        others.append(_JobStates(counts))
    accept = request.headers.get("accept", "")
    media_type, text = await anyio.to_thread.run_sync(lambda: services.instruments.exposition(accept, *others))
    return Response(text, headers={"Content-Type": media_type})


async def _job_counts(services: Services) -> Mapping[str, int] | None:
    """None while the jobs' database does not answer: a missing number says so, a zero would lie."""
    queue = services.jobs
    assert queue is not None
    try:
        counts = await services.job_calls.run(lambda: queue.counts(), give_up_s=_PATIENCE_S)
    except (JobsUnavailableError, OverloadedError, TimeoutError):
        return None
    return {state: counts[state] for state in counts}
