"""What a training job tells as it runs, for those who follow it live and those who read its log afterwards."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Callable, Sequence

import anyio
import structlog
from sse_starlette import ServerSentEvent

from service.api.http.event_stream import reconnect_after, server_sent_event
from service.api.http.limits.worker_threads import OverloadedError
from service.api.services import Services
from service.api.v1.admin.job_answers import LogLine, is_last, line_of
from service.errors import JobError
from service.jobs.job import ENDED, JobEvent
from service.jobs.queue import JobQueue
from service.wire.forms.numbers import dump

POLL_S = 0.5  # a worker writes at most two events a second
LONGEST_STREAM_S = 3600.0
_MOST_LOOKS = 100  # of 500 events each: more than a day-long job writes in an hour

_log = structlog.get_logger(__name__)


def new_events(queue: JobQueue, job_id: str, after: int | None) -> Sequence[JobEvent] | None:
    """The events after number `after` that are there by now; None when there will never be another. Blocks.

    Raises what `JobQueue.events` raises.
    """
    found = queue.events(job_id, after=after)
    if not found and queue.get(job_id).state in ENDED:
        return queue.events(job_id, after=after) or None  # it may have ended between the two looks
    return found


async def follow(
    services: Services,
    queue: JobQueue,
    job_id: str,
    news: Sequence[JobEvent],
    after: int | None,
    admitted: Callable[[], bool],
) -> AsyncIterator[ServerSentEvent]:
    """`news`, then what comes, until the job's last event, the end of the server, an hour, or no longer `admitted`.

    A database that fails ends it too: the client comes back with its `Last-Event-ID`, and is told so then.
    """
    ends_at = time.monotonic() + LONGEST_STREAM_S
    yield reconnect_after()
    while True:
        for event in news:
            after = event.number
            yield server_sent_event(event.number, event.kind, _data_of(event))
        if (news and is_last(news[-1])) or services.lifecycle.ending or time.monotonic() > ends_at:
            return
        await anyio.sleep(POLL_S)
        if not admitted():
            _log.info("a stream of events ended: its token is not in force any more", job=job_id)
            return
        try:
            news = await _look(services, queue, job_id, after)
        except (JobError, OverloadedError) as error:
            _log.warning("a stream of events ended early", job=job_id, reason=str(error))
            return


async def _look(services: Services, queue: JobQueue, job_id: str, after: int | None) -> Sequence[JobEvent]:
    return await services.job_calls.run(lambda: queue.events(job_id, after=after))


def _data_of(event: JobEvent) -> str:
    return dump({"time": event.time.isoformat(), **event.data}).decode()


def read_log(queue: JobQueue, job_id: str, after: int | None, limit: int) -> tuple[list[LogLine], int | None]:
    """At most `limit` lines of the log after event `after`, and the event to go on after; None when that was all.

    Blocks. Raises what `JobQueue.events` raises.
    """
    lines: list[LogLine] = []
    for _ in range(_MOST_LOOKS):
        events = queue.events(job_id, after=after)
        for event in events:
            if event.kind == "log":
                if len(lines) == limit:
                    return lines, after
                lines.append(line_of(event))
            after = event.number
        if not events or is_last(events[-1]):
            return lines, None
    return lines, after
