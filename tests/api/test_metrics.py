"""What Prometheus gets to see."""

from __future__ import annotations

import re
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pytest
from prometheus_client import CollectorRegistry, Histogram, generate_latest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as openmetrics_families
from prometheus_client.parser import text_string_to_metric_families

from service.api.http.instruments import Instruments, SeriesOfTimes
from service.twin import Outcome

PAGE = Path(__file__).parent.parent.parent / "docs" / "metrics.md"
VERSION = {"model_name": "viper-lunar", "model_version": "1"}


def samples(text: str) -> dict[tuple[str, frozenset], float]:
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


class Numbers(dict):
    def of(self, name: str, **labels: str) -> float:
        """The sum over all labels that were not given."""
        wanted = set(labels.items())
        return sum(value for (each, own), value in self.items() if each == f"rover_twin_{name}" and wanted <= own)


def scraped(client) -> Numbers:
    answer = client.get("/metrics")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"].startswith("text/plain")
    return Numbers(samples(answer.text))


def test_every_prediction_is_counted_once_by_version_outcome_and_domain(service):
    before = scraped(service.client)
    inside = [service.predict(slope_deg=slope).json() for slope in (12, 20, 28)]
    outside = [service.predict(slope_deg=slope).json() for slope in (-40, 45)]
    after = scraped(service.client)

    def rise(name: str, **labels: str) -> float:
        return after.of(name, **labels) - before.of(name, **labels)

    assert [each["domain"]["inside"] for each in (*inside, *outside)] == [True] * 3 + [False] * 2
    assert rise("predictions_total", **VERSION) == 5
    assert rise("predictions_outside_domain_total", **VERSION) == 2
    for outcome, count in Counter(each["summary"]["outcome"] for each in (*inside, *outside)).items():
        assert rise("predictions_total", outcome=outcome, **VERSION) == count
    assert rise("prediction_duration_seconds_count", **VERSION) == 5
    assert 0 < rise("prediction_duration_seconds_sum") <= rise("http_request_duration_seconds_sum")
    assert rise("http_requests_total", route="/v1/predictions", method="GET", status="200") == 5
    assert rise("http_request_duration_seconds_count", route="/v1/predictions") == 5


def test_readiness_probes_are_requests_but_no_predictions(service):
    before = scraped(service.client)
    for _ in range(3):
        assert service.get("/health/ready").status_code == 200
    after = scraped(service.client)

    assert after.of("predictions_total") == before.of("predictions_total")
    probes = {"route": "/health/ready", "status": "200"}
    assert after.of("http_requests_total", **probes) - before.of("http_requests_total", **probes) == 3


def test_the_cells_of_a_map_are_predictions(service):
    before = scraped(service.client)
    query = {"mass_kg": 430, "torque_min_nm": 30, "torque_max_nm": 90, "torque_steps": 2, "slope_steps": 3}
    assert service.get("/v1/mobility", **query).status_code == 200
    after = scraped(service.client)

    assert after.of("predictions_total") - before.of("predictions_total") == 6
    assert after.of("prediction_duration_seconds_count") - before.of("prediction_duration_seconds_count") == 1


def test_routes_are_templates_and_nothing_of_a_request_is_told(service):
    for path in ("/v1/models/a-secret", "/a-secret/path", "/v1/predictions?slope_deg=a-secret", "/v1/admin/a-secret"):
        assert service.client.get(path, headers={"X-Request-ID": "a-secret"}).status_code in (401, 403, 404, 422)
    service.client.request("ASECRET", "/v1/models")
    text = service.get("/metrics").text

    assert "secret" not in text.lower()
    known = Numbers(samples(text))
    assert known.of("http_requests_total", route="/v1/models/{name}", status="404") >= 1
    assert known.of("http_requests_total", route="no route", status="404") >= 1


def test_the_running_request_is_the_scrape_itself(service):
    assert scraped(service.client).of("http_requests_in_progress") == 1
    assert scraped(service.client).of("server_processes") == 1


@pytest.mark.slow
def test_what_is_resident_and_what_fails_is_shown(serve, store, publish, move):
    move(store, publish(store))
    running = serve()
    running.wait_ready()
    assert scraped(running.client).of("resident_versions") == 1
    move(store, publish(store, coefficient=0.3))
    running.predict(model="viper-lunar@2")
    shown = scraped(running.client)
    assert shown.of("resident_versions") == 2
    assert shown.of("model_loads_total") == 2
    assert shown.of("reference_failures") == 0


def test_openmetrics_for_who_asks(service):
    answer = service.client.get("/metrics", headers={"Accept": "application/openmetrics-text; version=1.0.0"})
    assert answer.headers["content-type"].startswith("application/openmetrics-text")
    assert {"rover_twin_http_requests", "rover_twin_predictions"} <= {
        family.name for family in openmetrics_families(answer.text)
    }


@pytest.mark.processes
def test_with_a_token_the_metrics_stay_open_and_count_the_jobs(service_with_token):
    client = service_with_token.client
    token = client.headers.pop("Authorization")
    try:
        deadline = time.monotonic() + 60  # they are absent until dbos is imported, seconds on a busy machine
        while "rover_twin_training_jobs" not in {name for name, _ in scraped(client)}:
            assert time.monotonic() < deadline
        shown = scraped(client)
    finally:
        client.headers["Authorization"] = token
    assert {own for name, own in shown if name == "rover_twin_training_jobs"} == {
        frozenset({("state", state)}) for state in ("queued", "running")
    }
    assert shown.of("training_jobs") == 0


def test_without_jobs_none_are_shown(service):
    assert "training_jobs" not in service.get("/metrics").text


@pytest.mark.parametrize("versions", [1, 64, 500])
def test_any_number_of_versions_takes_a_bounded_number_of_series(versions):
    instruments = Instruments()
    outcomes = (Outcome.CLIMBS, Outcome.STALLS, Outcome.CLIMBS)
    for version in range(1, versions + 1):
        instruments.predicted(SimpleNamespace(name="unit", version=version), 0.01, outcomes, 2)
    shown = Numbers(samples(instruments.exposition()[1].decode()))

    assert shown.of("predictions_total") == 3 * versions
    assert shown.of("predictions_outside_domain_total") == 2 * versions
    assert sum(name == "rover_twin_predictions_outside_domain_total" for name, _ in shown) == min(versions, 65)


@pytest.mark.slow
def test_the_page_names_every_metric_and_no_other(service_with_token):
    families = text_string_to_metric_families(service_with_token.get("/metrics").text)
    shown = {f"{each.name}{'_total' * (each.type == 'counter')}" for each in families if each.name.startswith("rover_")}
    assert set(re.findall(r"^\| `(rover_twin_\w+)`", PAGE.read_text(), re.MULTILINE)) == shown


@pytest.mark.parametrize("seconds", [0.0, 0.1, 0.1000001, 0.5, 7.0])
def test_times_are_counted_as_the_library_counts_them(seconds):
    def told(observe) -> bytes:
        registry = CollectorRegistry()
        observe(Histogram("seconds", "Seconds.", ("route",), buckets=(0.1, 0.5, 2.0), registry=registry).labels("a"))
        return re.sub(rb".*_created.*", b"", generate_latest(registry))

    assert told(lambda series: SeriesOfTimes(series).observe(seconds)) == told(lambda series: series.observe(seconds))
