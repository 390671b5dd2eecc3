"""Spans reach a real collector, belong together, and cost a request nothing when the collector is away."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from model_store import ModelStore
from service import tracing
from service.errors import MissingPartError
from service.settings import load_settings
from tests.api.conftest import QUESTION, move_alias, process_serving, publish_version
from tests.api.training import HEADERS, TOKEN, job_store, submit, working
from tests.tracing.collector import Seen, collecting

pytestmark = pytest.mark.processes

TRACE, CALLER = "0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331"
UNSAMPLED = "1af7651916cd43dd8448eb211c80319d"
TRACEPARENT = {"traceparent": f"00-{TRACE}-{CALLER}-01"}


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith("OTEL_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("OTEL_BSP_SCHEDULE_DELAY", "50")


@pytest.fixture
def store(tmp_path: Path) -> ModelStore:
    store = ModelStore.open(str(tmp_path / "store"), create=True)
    move_alias(store, publish_version(store))
    publish_version(store, coefficient=0.2)
    return store


def ended(process: subprocess.Popen[str]) -> list[dict]:
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=30)
    return [json.loads(line) for line in said.splitlines() if line.startswith("{")]


def chain(span: Seen, spans: list[Seen]) -> list[str]:
    """Names from the span up to the one whose parent is not ours."""
    by_id = {each.id: each for each in spans}
    names = [span.name]
    while span.parent in by_id:
        span = by_id[span.parent]
        names.append(span.name)
    return names


def test_a_request_and_what_it_needed_are_one_trace_that_the_client_began(store, monkeypatch):
    with collecting() as collector:
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", collector.url)
        with process_serving(store, log_level="info") as (client, process):
            asked = {**QUESTION, "model": "viper-lunar@2"}
            answer = client.get("/v1/predictions", params=asked, headers=TRACEPARENT)
            missing = client.get("/v1/models/nobody")
            client.get("/v1/predictions", params=QUESTION, headers={"traceparent": f"00-{UNSAMPLED}-{CALLER}-00"})
            client.get("/v1/mobility", params=QUESTION, headers={"traceparent": "nonsense"})
            client.get("/nothing/here")  # the last one
            collector.wait_for(lambda: collector.named("GET"))
            lines = ended(process)

    request = next(each for each in collector.spans if each.parent == CALLER)
    assert request.trace == TRACE
    assert request.name == "GET /v1/predictions"
    assert request.process == "server"
    assert request.attributes["http.route"] == "/v1/predictions"
    assert request.attributes["http.response.status_code"] == 200
    assert request.attributes["rover_twin.request_id"] == answer.headers["X-Request-ID"]
    ours = [each for each in collector.spans if each.trace == TRACE]
    paths = {" < ".join(chain(each, ours)) for each in ours}
    assert "predict < GET /v1/predictions" in paths
    assert "store read < load model < GET /v1/predictions" in paths
    other = collector.named("GET /v1/models/{name}")[0]
    assert other.trace != TRACE
    assert not other.failed  # 404 is the client's
    assert other.attributes["http.response.status_code"] == missing.status_code
    assert collector.named("GET /v1/mobility")
    assert not [each for each in collector.spans if "health" in each.name or each.trace == UNSAMPLED]
    line = next(each for each in lines if each.get("route") == "/v1/predictions")
    assert line["trace_id"] == TRACE


def test_a_training_job_goes_on_in_the_trace_of_its_submission(tmp_path, monkeypatch):
    folder = job_store(tmp_path)
    with collecting() as collector:
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", collector.url)
        served = process_serving(ModelStore.open(str(folder)), admin_token=TOKEN, start_worker=False)
        with served as (client, process), working(folder):
            client.headers.update({**HEADERS, **TRACEPARENT})
            job = submit(client)
            collector.wait_for(lambda: collector.named("training job"), timeout_s=120)
            ended(process)

    ours = [each for each in collector.spans if each.trace == TRACE]
    done = next(each for each in ours if each.name == "training job")
    assert done.process == "worker"
    assert done.attributes["rover_twin.job"] == job["id"]
    assert chain(done, ours) == ["training job", "POST /v1/admin/training-jobs"]
    for stage in ("prepare", "fit_chunk", "evaluate", "publish", "name_candidate", "judge", "tidy"):
        step = next(each for each in ours if each.name == f"training {stage}")
        assert chain(step, ours)[1] == "training job"


def test_a_collector_that_never_answers_holds_up_neither_requests_nor_the_end(store, monkeypatch):
    monkeypatch.setenv("OTEL_BSP_MAX_QUEUE_SIZE", "16")
    monkeypatch.setenv("OTEL_BSP_MAX_EXPORT_BATCH_SIZE", "8")
    with collecting(silent=True) as collector:
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", collector.url)
        with process_serving(store, drain_s=0) as (client, process):
            for _ in range(100):  # many more than the queue takes
                assert client.get("/v1/predictions", params=QUESTION).status_code == 200
            collector.wait_for(lambda: collector.requests)
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=20)  # far less than the exporter would wait

    assert process.returncode in (0, -signal.SIGTERM)


@pytest.mark.parametrize(
    ("variables", "on"),
    [
        ({}, False),
        ({"OTEL_SERVICE_NAME": "rover-twin"}, False),
        ({"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:9"}, True),
        ({"OTEL_EXPORTER_OTLP_TRACES_ENDPOINT": "http://127.0.0.1:9"}, True),
        ({"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:9", "OTEL_SDK_DISABLED": "true"}, False),
        ({"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:9", "OTEL_TRACES_EXPORTER": "none"}, False),
        ({"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:9", "ROVER_TWIN_TRACING": "false"}, False),
        ({"ROVER_TWIN_TRACING": "true"}, True),
    ],
)
def test_nothing_is_sent_unless_somebody_said_where_to(variables, on, monkeypatch):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)

    assert load_settings().traces() is on


def test_off_it_is_not_even_imported_and_on_without_the_library_it_says_so():
    told = """
import sys
from service import tracing
from service.settings import Settings
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.startswith("opentelemetry"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
tracing.begin(Settings(tracing=False), "test")
with tracing.span("nothing", model="x"):
    assert tracing.traceparent() is None
assert not [name for name in sys.modules if name.startswith("opentelemetry")]
sys.meta_path.insert(0, Absent())
try:
    tracing.begin(Settings(tracing=True), "test")
except Exception as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, timeout=60, check=True)

    assert done.stdout.startswith(MissingPartError.__name__)
    assert "rover-twin[tracing]" in done.stdout


def test_off_a_span_is_one_block_for_all():
    assert not tracing.is_on()
    assert tracing.span("a") is tracing.span("b", model="x")  # nothing is made
