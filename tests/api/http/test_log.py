"""One line per request, with the route's template and never the path or the query."""

from __future__ import annotations

import io
import json
import logging
import signal

import pytest
from structlog.testing import capture_logs

from service.api.http.errors import ErrorAnswers
from service.log import RequestLines, RequestRecord


def test_each_request_is_one_json_line(store, publish, move, question, own_process):
    move(store, publish(store))
    client, process = own_process(log_level="info", drain_s=0)
    asked = client.get("/v1/predictions", params=question, headers={"x-request-id": "asked-1"})
    client.get("/v1/models/secret-name")
    client.get("/secret-path")

    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=20) in (0, -signal.SIGTERM)
    text = process.stderr.read()

    lines = [json.loads(line) for line in text.splitlines()]
    requests = [line for line in lines if line["event"] == "request"]
    assert asked.headers["x-request-id"] == "asked-1"
    first = next(line for line in requests if line["request_id"] == "asked-1")
    assert (first["method"], first["route"], first["status"]) == ("GET", "/v1/predictions", 200)
    assert first["duration_ms"] > 0
    assert {line["client"] for line in requests} == {"127.0.0.1"}
    assert [(line["route"], line["status"]) for line in requests[1:]] == [("/v1/models/{name}", 404), ("no route", 404)]
    assert "secret" not in "".join(json.dumps(line) for line in requests)


def test_a_fault_is_logged_without_the_path():
    with capture_logs() as lines:
        answer = ErrorAnswers({})(RuntimeError("a fault"), "/v1/models/secret-name")

    assert answer.status_code == 500
    assert [(line["event"], str(line["exc_info"])) for line in lines] == [("a request failed", "a fault")]
    assert "secret" not in str(lines)


@pytest.mark.parametrize("line_buffering", [True, False])
def test_a_line_is_there_at_once(line_buffering):
    raw = io.BytesIO()
    stream = io.TextIOWrapper(io.BufferedWriter(raw), line_buffering=line_buffering)
    RequestLines(stream, "json").handle(RequestRecord(logging.INFO, {"status": 200}))

    line = json.loads(raw.getvalue())
    assert (line["event"], line["level"], line["status"]) == ("request", "info", 200)


def test_a_line_that_cannot_be_written_costs_nothing_else(monkeypatch):
    monkeypatch.setattr(logging, "raiseExceptions", False)
    stream = io.StringIO()
    lines = RequestLines(stream, "console")
    stream.close()
    assert lines.handle(RequestRecord(logging.INFO, {"status": 200}))
