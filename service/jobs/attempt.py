"""One attempt at a job, in one worker: whether it may go on, its steps, and what it tells of itself."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cached_property
from typing import Any, Protocol

import sqlalchemy as sa
import structlog
from dbos import DBOS, StepOptions, WorkflowStatus
from dbos import error as dbos_errors

from model_store import ModelStore, StoreUnavailableError
from service import tracing
from service.errors import JobsUnavailableError
from service.jobs.database import JobsDatabase
from service.jobs.events import JobReport
from service.jobs.failure import JobFailedError, worker_lost
from service.learning.network.fit import FitProgress

_WATCH_S = 1.0
_MOST_DEATHS = 5
_TRIED_AGAIN: StepOptions = {
    "retries_allowed": True,
    "max_attempts": 5,
    "interval_seconds": 0.5,
    "backoff_rate": 2.0,
    "should_retry": lambda error: isinstance(error, StoreUnavailableError),
}

_log = structlog.get_logger(__name__)


class Runner(Protocol):
    """The worker, as a job sees it."""

    name: str
    store: ModelStore
    database: JobsDatabase

    def enter(self, job_id: str) -> None:
        """A job begins to run here."""

    def leave(self, job_id: str) -> None:
        """It no longer does."""

    def is_ending(self) -> bool:
        """Whether the worker was told to end."""

    def is_alive(self) -> bool:
        """Whether the others still take this worker for alive."""


class Attempt:
    """One attempt at a job. All that it tells waits while the database is away, and looks first whether to go on."""

    def __init__(self, runner: Runner, job_id: str) -> None:
        self._runner = runner
        self._id = job_id
        self._looked = -math.inf
        self._got_further = False

    def step(self, step: Callable[..., dict[str, Any]], *arguments: Any) -> dict[str, Any]:  # noqa: ANN401
        """Run a step, or take its result from an earlier attempt."""
        self.look(now=True)
        options: StepOptions = {**_TRIED_AGAIN, "name": step.__name__.strip("_")}
        ran = False

        def run(*given: Any) -> dict[str, Any]:  # noqa: ANN401
            nonlocal ran
            ran = True
            # here too: dbos would record it as what the step came to
            with self._left_when_the_database_fails(), tracing.span(f"training {options['name']}", job=self._id):
                return step(*given)

        with self._left_when_the_database_fails():
            result = DBOS.run_step(options, run, *arguments)
        if ran and not self._got_further:
            self._forgive_deaths()
        return result

    def tell(self, message: str) -> None:
        """A line for people."""
        self.look()
        self._report.log(message)

    def show(self, phase: str, part: float) -> None:
        """The job is `part` of the way through a phase."""
        self.look()
        self._report.phase(phase, part)

    def show_epoch(self, reached: FitProgress) -> None:
        """An epoch is finished. A worker that is to end leaves after it, in order, so that is no reason to raise."""
        self.look(abandon=False)
        self._report.epoch(reached)

    def look(self, *, now: bool = False, abandon: bool = True) -> None:
        """Leave when the job was cancelled or is no longer ours, or (`abandon`) when the worker is to end.

        dbos lets go of an attempt that ends this way: nothing is recorded, and another may run the step again.
        """
        if abandon and self._runner.is_ending():
            raise dbos_errors.DBOSWorkflowCancelledError(f"the worker ends, training job {self._id} goes back")
        if not now and time.monotonic() - self._looked < _WATCH_S:
            return
        self._looked = time.monotonic()
        try:
            row = self._runner.database.row(self._id)
        except JobsUnavailableError:
            return  # what is computed stays good; recording it waits for the database
        if (
            row is None
            or row.status != "PENDING"
            or row.executor_id != self._runner.name
            or not self._runner.is_alive()
        ):
            raise dbos_errors.DBOSWorkflowCancelledError(f"training job {self._id} was cancelled or taken over")

    def require_fewer_deaths(self) -> None:
        """Raises JobFailedError when worker after worker died at this place."""
        try:
            row = self._runner.database.row(self._id)
        except JobsUnavailableError:
            return
        deaths = 0 if row is None else _deaths(row) - _noted(row, "forgiven")
        if deaths >= _MOST_DEATHS:
            raise JobFailedError(worker_lost(deaths))

    def _forgive_deaths(self) -> None:
        """A step is finished that no earlier attempt has finished: what killed their workers is overcome."""
        with suppress(JobsUnavailableError):
            row = self._runner.database.row(self._id)
            if row is not None and _deaths(row):
                self._runner.database.forgive(self._id, _deaths(row))
            self._got_further = True

    @contextmanager
    def _left_when_the_database_fails(self) -> Iterator[None]:
        """An error of the jobs database says nothing about the job: the attempt ends, another goes on later."""
        try:
            yield
        except (sa.exc.SQLAlchemyError, JobsUnavailableError) as error:
            _log.warning("training job left, its database fails", job=self._id, reason=str(error).partition("\n")[0])
            raise dbos_errors.DBOSWorkflowCancelledError(f"training job {self._id} goes on later") from error

    @cached_property
    def _report(self) -> JobReport:
        """Made by the first thing that an attempt really does, in a step."""
        attempt, started_at = 1, None
        with suppress(JobsUnavailableError):
            row = self._runner.database.row(self._id)
            attempt = row.recovery_attempts or 1 if row else 1
            started_at = (self._runner.database.note(self._id) or {}).get("started_at")
        report = JobReport(started_at)
        report.began(attempt)
        return report


def came_with(runner: Runner, job_id: str) -> dict[str, str]:
    """The trace in which the job was submitted, as `tracing.continued` takes it; empty where no trace is kept."""
    if not tracing.is_on():
        return {}
    with suppress(JobsUnavailableError):
        row = runner.database.row(job_id)
        parent = (row.attributes or {}).get("traceparent") if row is not None else None
        return {"traceparent": str(parent)} if parent else {}
    return {}


def _deaths(row: WorkflowStatus) -> int:
    """Attempts that ended with their worker, before this one."""
    return (row.recovery_attempts or 1) - 1 - _noted(row, "hand_backs")


def _noted(row: WorkflowStatus, name: str) -> int:
    return int((row.attributes or {}).get(name, 0))
