"""How far the events of a job have been read, and when to connect again; for both clients. No I/O.

The client gives up after `RECONNECTS` connections in a row without an event.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from http import HTTPStatus

from httpx_sse import ServerSentEvent
from tenacity import RetryCallState, retry_if_exception_type, stop_after_delay, wait_fixed

from rover_twin_client import responses, training_parsing
from rover_twin_client.calls import refused
from rover_twin_client.document import Node
from rover_twin_client.errors import (
    ConnectionFailedError,
    NotReadyError,
    TimedOutError,
    TrainingFailedError,
    UnexpectedAnswerError,
)
from rover_twin_client.network import Retries
from rover_twin_client.training import JobEvent, TrainingJob

RECONNECTS = 30  # a minute, with the pause of two seconds that the service asks for: enough for a restart
# The service sends a comment every 15 s. A connection that is silent for three times as long is dead.
SILENCE_S = 45.0
_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0
_LOOK_EVERY_S = 1.0
_DROPS = (ConnectionFailedError, TimedOutError, NotReadyError)
_DROPPED = retry_if_exception_type(_DROPS)


class Following:
    """How far the events of one job have been read."""

    def __init__(self, after: int | None, retries: int) -> None:
        if after is not None and (isinstance(after, bool) or not isinstance(after, int) or after < 0):
            raise refused("after", after, "the number of an event, 0 or more")
        self.number = after
        self.ended = False
        self._tries = 1 + retries  # for the first connection only: a wrong address must fail soon
        self._pause_s = _PAUSE_S

    def headers(self) -> dict[str, str]:
        """The headers of the next request."""
        headers = {"Accept": "text/event-stream", "Cache-Control": "no-store"}
        return headers if self.number is None else headers | {"Last-Event-ID": str(self.number)}

    def accept(self, status: int, headers: Mapping[str, str], content: bytes) -> None:
        """Checks the head of an answer. `content` is its body, unless it is a stream. After 204 no event will come."""
        if status == HTTPStatus.NO_CONTENT:
            self.ended = True
            return
        responses.require(status, headers, content, (HTTPStatus.OK,))
        kind = headers.get("content-type", "")
        if not kind.startswith("text/event-stream"):
            raise UnexpectedAnswerError(f"the answer is {kind!r}, expected text/event-stream: is base_url right?")
        self._tries = 1 + RECONNECTS

    def read(self, sent: ServerSentEvent) -> JobEvent | None:
        """The event that was sent; None for a comment, a new pause, or an event that was read before."""
        if sent.retry is not None:
            self._pause_s = min(sent.retry / 1000, _LONGEST_PAUSE_S)
        if not sent.data:
            return None
        try:
            number, data = int(sent.id), json.loads(sent.data)
        except (ValueError, RecursionError) as fault:
            raise UnexpectedAnswerError(f"the event {sent!r:.200} cannot be read") from fault
        if self.number is not None and number <= self.number:
            return None
        event = training_parsing.event(number, sent.event, Node(data, f"event {number}"))
        self.number, self.ended = number, event.is_last
        return event

    def again(self, kind: type[Retries]) -> Retries:
        """Runs a function again as long as it fails because of the connection."""
        return kind(stop=self._gives_up, wait=self._wait, retry=_DROPPED, reraise=True)

    def _gives_up(self, state: RetryCallState) -> bool:
        return state.attempt_number >= self._tries

    def _wait(self, _: RetryCallState) -> float:
        return self._pause_s


class Waiting:
    """Looks at a job every second until it has ended. It gives up after `RECONNECTS` failed looks in a row."""

    def __init__(self, timeout_s: float, report: Callable[[int], None] = lambda _: None) -> None:
        if not 0 < timeout_s < float("inf"):
            raise refused("timeout_s", timeout_s, "more than 0 seconds, and finite")
        self._timeout_s = timeout_s
        self._seen = False
        self._drops = 0
        self._report = report
        self._percent = 0

    def looking(self, kind: type[Retries]) -> Retries:
        """Runs a function that gets the job until the job has ended; raises TimedOutError when that takes too long."""
        stop, pause = stop_after_delay(self._timeout_s), wait_fixed(_LOOK_EVERY_S)
        return kind(stop=stop, wait=pause, retry=self._goes_on, retry_error_callback=self._late)

    def _goes_on(self, state: RetryCallState) -> bool:
        assert state.outcome is not None
        if state.outcome.failed:
            self._drops += 1
            return isinstance(state.outcome.exception(), _DROPS) and self._seen and self._drops <= RECONNECTS
        self._seen, self._drops = True, 0
        job: TrainingJob = state.outcome.result()
        self._tell(job)
        return not job.ended

    def _tell(self, job: TrainingJob) -> None:
        """Reports how many more percents are done: never fewer than before, also when a phase begins anew."""
        done = 100 if job.state == "succeeded" else int(100 * job.progress.fraction) if job.progress else 0
        if done > self._percent:
            self._report(done - self._percent)
            self._percent = done

    def _late(self, state: RetryCallState) -> TrainingJob:
        assert state.outcome is not None
        job: TrainingJob = state.outcome.result()  # raises the failure of the last look, if it failed
        raise TimedOutError(f"training job {job.id} is still {job.state} after {self._timeout_s:g} s, and goes on")


def succeeded(job: TrainingJob) -> TrainingJob:
    """Returns the job; raises TrainingFailedError when it ended without a version."""
    if job.state == "succeeded":
        return job
    reason = f": {job.failure.message} {job.failure.remedy}" if job.failure else ""
    raise TrainingFailedError(f"training job {job.id} did not succeed ({job.state}){reason}", job)


def ended_early() -> ConnectionFailedError:
    """The error for a stream that closed before the job's last event: the service restarted, or an hour was over."""
    return ConnectionFailedError("the stream of events closed before the job ended")
