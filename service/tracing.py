"""Spans for an OpenTelemetry collector: the only place that knows the library, which is imported when it is asked for.

Off, a span costs one look at a variable. On, ended spans wait in a bounded queue for a thread that sends them; when the
collector is slow or away, new ones are dropped and no request waits. Endpoint, sampling and queue are set by the
standard variables (OTEL_..., docs/tracing.md).
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING, Any, Protocol

import structlog

import service
from model_store import observe_calls
from service.errors import MissingPartError
from service.log import trace_id
from service.settings import Settings

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.trace import Span, Tracer

_END_S = 3.0
_NOTHING: AbstractContextManager[None] = nullcontext()

_log = structlog.get_logger(__name__)
_tracer: Tracer | None = None
_provider: TracerProvider | None = None


def begin(settings: Settings, process: str) -> None:
    """Make spans in this process from here on, if the settings ask for it; `process` is what it does.

    Raises MissingPartError when the library is not installed, but for settings that leave it to standard variables.
    """
    global _tracer, _provider
    if not settings.traces() or _tracer is not None:
        return
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter  # noqa: PLC0415
        from opentelemetry.sdk.resources import SERVICE_NAME, Resource  # noqa: PLC0415
        from opentelemetry.sdk.trace import TracerProvider  # noqa: PLC0415
        from opentelemetry.sdk.trace.export import BatchSpanProcessor  # noqa: PLC0415
    except ImportError as error:
        if settings.tracing is None:  # the variables may be set for all that runs on a cluster
            _log.warning("no traces: OpenTelemetry is not installed here")
            return
        reason = "traces need OpenTelemetry, not installed here: pip install 'rover-twin[tracing]'"
        raise MissingPartError(f"{reason}, or ROVER_TWIN_TRACING=false") from error
    usual = Resource(
        {SERVICE_NAME: "rover-twin", "service.version": service.__version__, "rover_twin.process": process}
    )
    _provider = TracerProvider(resource=usual.merge(_named()), shutdown_on_exit=False)
    _provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    _tracer = _provider.get_tracer("rover-twin", service.__version__)
    observe_calls(lambda doing, key: span(f"store {doing}", key=key))


def end() -> None:
    """Send what waits, for 3 s at most, and make no more spans."""
    global _tracer, _provider
    ending, _tracer, _provider = _provider, None, None
    if ending is None:
        return
    observe_calls(None)
    sending = threading.Thread(target=ending.shutdown, name="last spans", daemon=True)
    sending.start()
    sending.join(_END_S)


def is_on() -> bool:
    """Whether spans are made."""
    return _tracer is not None


def span(name: str, **attributes: str | int | float | bool) -> AbstractContextManager[Any]:
    """A part of what is being done now; an error that leaves the block is noted."""
    if _tracer is None:
        return _NOTHING
    return _tracer.start_as_current_span(name, attributes=_ours(attributes))


class Version(Protocol):
    """What has a name and a number: a twin."""

    @property
    def name(self) -> str:
        """Of the model."""

    @property
    def version(self) -> int:
        """Its number."""


def span_of(name: str, twin: Version, scenarios: int) -> AbstractContextManager[Any]:
    """`span` for what a version computes; off, not even its name is asked for."""
    if _tracer is None:
        return _NOTHING
    return span(name, model=twin.name, version=twin.version, scenarios=scenarios)


def traceparent() -> str | None:
    """Where we are, as W3C Trace Context writes it, for whoever goes on elsewhere; None without a span."""
    if _tracer is None:
        return None
    carrier: dict[str, str] = {}
    _propagator().inject(carrier)
    return carrier.get("traceparent")


@contextmanager
def continued(
    name: str, came_with: Mapping[str, str], attributes: Mapping[str, str | int], *, serves: bool = False
) -> Iterator[Span | None]:
    """A span that goes on where the `traceparent` in `came_with` says, else a new trace; its id is in all log lines.

    `serves` says that it answers a request; otherwise it is work that was queued.
    """
    if _tracer is None:
        yield None
        return
    from opentelemetry.trace import SpanKind, format_trace_id  # noqa: PLC0415

    kind = SpanKind.SERVER if serves else SpanKind.CONSUMER
    context = _propagator().extract(came_with)
    with _tracer.start_as_current_span(name, context, kind, attributes=attributes) as made:
        token = trace_id.set(format_trace_id(made.get_span_context().trace_id))
        try:
            yield made
        finally:
            trace_id.reset(token)


def _ours(attributes: Mapping[str, str | int | float | bool]) -> dict[str, str | int | float | bool]:
    return {f"rover_twin.{name}": value for name, value in attributes.items()}


def _propagator() -> Any:  # noqa: ANN401 - its type is imported with it
    # this one only: baggage would carry what strangers write
    from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator  # noqa: PLC0415

    return TraceContextTextMapPropagator()


def _named() -> Any:  # noqa: ANN401 - its type is imported with it
    """What OTEL_SERVICE_NAME and OTEL_RESOURCE_ATTRIBUTES say of this process."""
    from opentelemetry.sdk.resources import OTELResourceDetector  # noqa: PLC0415

    return OTELResourceDetector().detect()
