"""An OpenTelemetry collector in small: takes spans over HTTP on loopback, as OTLP says, and keeps them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import (
    ExportTraceServiceRequest,
    ExportTraceServiceResponse,
)


@dataclass(frozen=True)
class Seen:
    """One span as it came, ids in hexadecimal."""

    name: str
    trace: str
    id: str
    parent: str
    process: str
    failed: bool
    attributes: dict[str, object]


class Collector(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, *, silent: bool = False) -> None:
        super().__init__(("127.0.0.1", 0), Receiving)
        self.spans: list[Seen] = []
        self.requests = 0
        self.silent = silent
        self.closing = threading.Event()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"

    def named(self, name: str) -> list[Seen]:
        return [each for each in self.spans if each.name == name]

    def wait_for(self, condition: Callable[[], object], timeout_s: float = 30.0) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, sorted({each.name for each in self.spans})
            time.sleep(0.05)


class Receiving(BaseHTTPRequestHandler):
    server: Collector

    def do_POST(self) -> None:
        self.server.requests += 1
        body = self.rfile.read(int(self.headers["Content-Length"]))
        if self.server.silent:
            self.server.closing.wait(60)
            return
        assert self.path == "/v1/traces"
        self.server.spans += spans_of(ExportTraceServiceRequest.FromString(body))
        answer = ExportTraceServiceResponse().SerializeToString()
        self.send_response(200)
        self.send_header("Content-Type", "application/x-protobuf")
        self.send_header("Content-Length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *arguments: object) -> None:
        """Quiet."""


def spans_of(message: ExportTraceServiceRequest) -> Iterator[Seen]:
    for of_process in message.resource_spans:
        resource = values(of_process.resource.attributes)
        assert resource["service.name"] == "rover-twin"
        for scope in of_process.scope_spans:
            for span in scope.spans:
                ids = span.trace_id.hex(), span.span_id.hex(), span.parent_span_id.hex()
                failed = span.status.code == span.status.STATUS_CODE_ERROR
                yield Seen(span.name, *ids, str(resource["rover_twin.process"]), failed, values(span.attributes))


def values(attributes) -> dict[str, object]:
    return {each.key: getattr(each.value, each.value.WhichOneof("value")) for each in attributes}


@contextmanager
def collecting(*, silent: bool = False) -> Iterator[Collector]:
    with Collector(silent=silent) as collector:
        threading.Thread(target=collector.serve_forever, daemon=True).start()
        try:
            yield collector
        finally:
            collector.closing.set()
            collector.shutdown()
