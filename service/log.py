"""Logging, configured once: structlog for our own lines, and the same look for those of the libraries."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Mapping
from contextvars import ContextVar
from typing import Literal, TextIO

import orjson
import structlog
from structlog.typing import EventDict, Processor

REQUESTS = "service.requests"
"""Name of the logger whose records are one line for each request: their message is a mapping of what to say."""

request_id: ContextVar[str] = ContextVar("request_id")
"""The request that is being answered, for the lines that are written meanwhile."""

trace_id: ContextVar[str] = ContextVar("trace_id")
"""The trace that this is part of, where there are traces (`service.tracing`)."""


def configure_logging(level: str = "info", form: Literal["console", "json"] = "console") -> None:
    """Send all logging to stderr as lines for people or as JSON objects. Calling it again replaces the first."""
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        _with_ids,
        structlog.stdlib.add_logger_name,
        structlog.stdlib.add_log_level,
        structlog.stdlib.ExtraAdder(),
        _without_colours,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *shared,
            structlog.stdlib.PositionalArgumentsFormatter(),
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *_renderers(form)],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.upper())
    requests = logging.getLogger(REQUESTS)
    requests.handlers[:], requests.propagate = [RequestLines(sys.stderr, form)], False


class RequestRecord(logging.LogRecord):
    """The record of one line about a request: what it says, and nothing of threads, files and lines of code.

    To find these out takes longer than to write the line.
    """

    def __init__(self, level: int, said: Mapping[str, object]) -> None:  # not the other's: that is the point
        self.__dict__.update(_BLANK)
        self.msg: object = said
        self.levelno, self.levelname = level, _LEVELS[level]
        self.created = time.time()


_LEVELS = {logging.DEBUG: "DEBUG", logging.INFO: "INFO"}
_BLANK = vars(logging.LogRecord(REQUESTS, logging.INFO, __file__, 0, "", None, None))


class RequestLines(logging.Handler):
    """Writes the line of a request as structlog would, without structlog, in a tenth of its time.

    One call of `write` for each line, which a stream of text does in one piece: there is nothing to lock.
    """

    def __init__(self, stream: TextIO, form: Literal["console", "json"]) -> None:
        super().__init__()
        self._stream, self._json = stream, form == "json"
        self._waits = not getattr(stream, "line_buffering", False)
        self._second, self._stamp = -1, ""

    def handle(self, record: logging.LogRecord) -> bool:
        """What a logger calls; the record's message is a mapping of names to texts and numbers."""
        try:
            self._stream.write(self.format(record))
            if self._waits:
                self._stream.flush()
        except Exception:  # a line that cannot be written must not cost the answer
            self.handleError(record)
        return True

    def format(self, record: logging.LogRecord) -> str:
        """One line and its end."""
        now, said = record.created, record.msg
        second = int(now)
        if second != self._second:
            self._second, self._stamp = second, time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(second))
        stamp, level = f"{self._stamp}.{int((now - second) * 1e6):06d}Z", record.levelname.lower()
        assert isinstance(said, dict)
        if known := trace_id.get(""):
            said = {**said, "trace_id": known}
        if self._json:
            line = {"event": "request", "logger": record.name, "level": level, "timestamp": stamp, **said}
            return orjson.dumps(line, option=orjson.OPT_APPEND_NEWLINE).decode()
        told = " ".join([f"{name}={value}" for name, value in said.items()])
        return f"{stamp} [{level:<9}] {'request':<30} [{record.name}] {told}\n"


def _with_ids(_logger: object, _method: str, event: EventDict) -> EventDict:
    if known := request_id.get(""):
        event["request_id"] = known
    if known := trace_id.get(""):
        event["trace_id"] = known
    return event


def _without_colours(_logger: object, _method: str, event: EventDict) -> EventDict:
    """Uvicorn adds its message a second time, with terminal colours."""
    event.pop("color_message", None)
    return event


def _renderers(form: str) -> list[Processor]:
    if form == "json":
        # without the local variables: those may hold what must not be logged, and arrays
        frames = structlog.tracebacks.ExceptionDictTransformer(show_locals=False)
        return [structlog.processors.ExceptionRenderer(frames), structlog.processors.JSONRenderer()]
    return [
        structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), exception_formatter=structlog.dev.plain_traceback)
    ]
