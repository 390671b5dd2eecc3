"""One training job as a durable workflow: short steps whose results dbos keeps, so that any worker can go on.

    prepare -> fit, a few seconds at a time -> evaluate -> publish -> candidate -> champion -> tidy up

What a step needs and did not get from the steps before it is computed again, which gives the same: everything here is
deterministic but the clock. A step that was killed runs again from its start, so each one may run twice.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from typing import Any, Protocol

import structlog
from dbos import DBOS, StepOptions, WorkflowStatus
from dbos import error as dbos_errors

from model_store import CorruptArtefactError, FileEntry, ModelStore, StoreError, StoreUnavailableError
from service.errors import JobsUnavailableError
from service.jobs.database import JobsDatabase
from service.jobs.events import JobReport
from service.jobs.failure import JobFailedError, failure_of, worker_lost
from service.jobs.job import WORKFLOW, JobFailure, JobProgress, JobResult
from service.jobs.request import TrainingJobRequest
from service.learning.evaluate import summarise
from service.learning.network.fit import FitProgress
from service.learning.network.fit_state import FitState
from service.training.chunked_fit import ChunkedFit
from service.training.promotion import CANDIDATE, CHAMPION, JobVersion, describe_move, judge, move_candidate
from service.training.train import Prepared, Trained, evaluate_fitted, prepare, publish_trained

CHUNK_S = 3.0
_WATCH_S = 1.0
_MOST_DEATHS = 5
# Of dbos's own: only for what dies before it can count. Hand-backs count there, so it is far above ours.
_MOST_ATTEMPTS = 1000
_TRIED_AGAIN: StepOptions = {
    "retries_allowed": True,
    "max_attempts": 5,
    "interval_seconds": 0.5,
    "backoff_rate": 2.0,
    "should_retry": lambda error: isinstance(error, StoreUnavailableError),
}
# Where in a job each phase begins, as a share of the whole.
_SHARES = {"loading": 0.0, "fitting": 0.05, "evaluating": 0.85, "publishing": 0.95, "judging": 0.98, "done": 1.0}

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


def register_workflow(runner: Runner) -> None:
    """Tell dbos how jobs are run; before it is launched."""

    def train(request: dict[str, Any], actor: str) -> dict[str, Any]:
        job_id = DBOS.workflow_id
        assert job_id is not None
        runner.enter(job_id)
        try:
            return _Job(runner, job_id, TrainingJobRequest.model_validate(request), actor).run()
        finally:
            runner.leave(job_id)

    DBOS.workflow(name=WORKFLOW, max_recovery_attempts=_MOST_ATTEMPTS)(train)


class _Job:
    """One attempt at a job, in one worker. What it has computed lives as long as the attempt."""

    def __init__(self, runner: Runner, job_id: str, request: TrainingJobRequest, actor: str) -> None:
        self._runner = runner
        self._store = runner.store
        self._id = job_id
        self._request = request
        self._actor = actor
        self._report: JobReport | None = None
        self._looked = -math.inf
        self._state: FitState | None = None
        self._trained: Trained | None = None
        self._got_further = False

    def run(self) -> dict[str, Any]:
        """All steps, or those that no earlier attempt has finished. Raises JobFailedError when one fails."""
        try:
            self._require_fewer_deaths()
            self._step(self._prepare)
            fit = self._fit()
            metrics = self._step(self._evaluate, fit)
            version = self._step(self._publish, fit)["version"]
            candidate = self._step(self._name_candidate, version)
            judged = self._step(self._judge, version)
            self._step(self._tidy)
        except Exception as error:
            raise self._failed(failure_of(error)) from None
        moves = [candidate, *judged["moves"]]
        result = JobResult(
            model=self._request.model,
            version=version,
            metrics=metrics,
            comparison=judged["comparison"],
            promoted=any(move["alias"] == CHAMPION for move in moves),
            moves=tuple(moves),
        )
        return result.model_dump(mode="json")

    # ---- the steps

    def _prepare(self) -> dict[str, Any]:
        split = self._prepared.split
        self._tell(f"{len(split.train)} runs to train on, {len(split.test)} kept for testing")
        return {"train_runs": len(split.train), "test_runs": len(split.test)}

    def _fit(self) -> dict[str, Any]:
        """Chunk after chunk until the fit is finished or its time is up; the last chunk's account of itself."""
        done: dict[str, Any] = {"finished": False, "seconds": 0.0, "epoch": 0, "file": None}
        while not done["finished"]:
            done = self._step(self._fit_chunk, done)
        return done

    def _fit_chunk(self, before: dict[str, Any]) -> dict[str, Any]:
        started = time.monotonic()
        if not self._fitting.in_pieces:
            self._show("fitting", 0.0)
            self._complete(None, 0.0)
            return {**before, "finished": True, "seconds": time.monotonic() - started}
        chunk = self._fitting.advance(self._load_state(before), CHUNK_S, self._after_epoch)
        self._state = chunk.state
        seconds = before["seconds"] + time.monotonic() - started
        finished = chunk.finished or seconds >= 60 * self._request.budget.max_minutes
        if chunk.state is None:
            return {**before, "finished": True, "seconds": seconds}
        file = f"fit-{chunk.state.epoch:06d}.safetensors"
        kept = self._store.put_work(self._id, file, chunk.state.to_bytes())
        for name in self._store.work_names(self._id):  # a replayed chunk may want the state before this one
            if name not in (file, before["file"]):
                self._store.remove_work(self._id, name)
        place = {"file": file, "sha256": kept.sha256, "size_bytes": kept.size_bytes}
        return {"finished": finished, "seconds": seconds, "epoch": chunk.state.epoch, **place}

    def _evaluate(self, fit: dict[str, Any]) -> dict[str, Any]:
        trained = self._complete(self._load_state(fit), fit["seconds"])
        self._show("evaluating", 1.0)
        return {
            "test": summarise(trained.test_evaluations),
            "left_out": summarise(trained.left_out_evaluations),
            "train": summarise(trained.train_evaluations),
        }

    def _publish(self, fit: dict[str, Any]) -> dict[str, Any]:
        published = self._store.published_once(self._request.model, self._id)
        if published is None:
            trained = self._complete(self._load_state(fit), fit["seconds"])
            self._show("publishing", 0.0)
            published = publish_trained(
                self._store,
                self._prepared.config,
                trained,
                created_by=self._actor,
                command=f"training job {self._id}",
                job=self._id,
                check=lambda: self._look(now=True),
            )
        self._tell(f"published {published.name}@{published.version}")
        return {"version": published.version}

    def _name_candidate(self, version: int) -> dict[str, Any]:
        move = move_candidate(self._store, self._version(version))
        self._tell(f"{self._request.model}@{CANDIDATE} is version {version}")
        return describe_move(CANDIDATE, move)

    def _judge(self, version: int) -> dict[str, Any]:
        self._show("judging", 0.0)
        wanted = self._request.promote == "if_better"
        judged = judge(
            self._store,
            self._version(version),
            margin=self._request.margin,
            promote=wanted,
            check=lambda: self._look(now=True),
        )
        self._tell(judged.comparison.sentence())
        moves = [describe_move(CHAMPION, judged.move)] if judged.move else []
        if moves:
            self._tell(f"{self._request.model}@{CHAMPION} is version {version}")
        return {"comparison": judged.comparison.describe(), "moves": moves}

    def _tidy(self) -> dict[str, Any]:
        self._remove_work()
        self._show("done", 1.0)
        return {}

    # ---- what steps are made of

    @cached_property
    def _prepared(self) -> Prepared:
        self._show("loading", 0.0)
        return prepare(self._store, self._request.training_config(), self._tell)

    @cached_property
    def _fitting(self) -> ChunkedFit:
        return ChunkedFit(self._prepared)

    def _complete(self, state: FitState | None, elapsed_s: float) -> Trained:
        """The finished model, computed once in an attempt."""
        if self._trained is None:
            fitted = self._fitting.finish(state, elapsed_s, self._tell, self._look)
            self._show("evaluating", 0.0)
            self._trained = evaluate_fitted(self._prepared, fitted, self._tell, self._look)
        return self._trained

    def _load_state(self, done: dict[str, Any]) -> FitState | None:
        """The state that a chunk left; None before the first, and where its file is damaged: then it is fitted anew."""
        if done["file"] is None or (self._state is not None and self._state.epoch == done["epoch"]):
            return self._state
        entry = FileEntry(sha256=done["sha256"], size_bytes=done["size_bytes"])
        try:
            self._state = FitState.from_bytes(self._store.read_work(self._id, done["file"], entry))
        except CorruptArtefactError as error:
            self._tell(f"the saved state cannot be used, the fit starts again: {error}")
            return None
        self._tell(f"going on after epoch {done['epoch']}")
        return self._state

    def _version(self, version: int) -> JobVersion:
        return JobVersion(self._request.model, version, self._id, self._actor)

    def _after_epoch(self, reached: FitProgress) -> bool:
        """Look and tell now and then; true when the worker is to end, which ends the chunk in order."""
        self._look(abandon=False)
        if self._telling.is_time():
            progress = JobProgress(
                phase="fitting",
                fraction=_share("fitting", reached.epoch / reached.epochs),
                epoch=reached.epoch,
                epochs=reached.epochs,
                train_error_m=math.sqrt(reached.train_loss_m2),
                validation_error_m=math.sqrt(reached.validation_loss_m2),
                eta_s=reached.remaining_s,
            )
            self._telling.progress(progress)
        return self._runner.is_ending()

    def _step(self, step: Callable[..., dict[str, Any]], *arguments: Any) -> dict[str, Any]:  # noqa: ANN401
        """Run a step, or take its result from an earlier attempt."""
        self._look(now=True)
        options: StepOptions = {**_TRIED_AGAIN, "name": step.__name__.strip("_")}
        ran = False

        def run(*given: Any) -> dict[str, Any]:  # noqa: ANN401
            nonlocal ran
            ran = True
            return step(*given)

        result = DBOS.run_step(options, run, *arguments)
        if ran and not self._got_further:
            self._forgive_deaths()
        return result

    @property
    def _telling(self) -> JobReport:
        """The report; made by the first thing that an attempt really does, in a step."""
        if self._report is None:
            attempt, started_at = 1, None
            with suppress(JobsUnavailableError):
                row = self._runner.database.row(self._id)
                attempt = row.recovery_attempts or 1 if row else 1
                started_at = (self._runner.database.note(self._id) or {}).get("started_at")
            self._report = JobReport(started_at)
            self._report.began(attempt)
        return self._report

    def _tell(self, message: str) -> None:
        self._look()
        self._telling.log(message)

    def _show(self, phase: str, part: float) -> None:
        self._look()
        self._telling.progress(JobProgress(phase=phase, fraction=_share(phase, part)))

    def _look(self, *, now: bool = False, abandon: bool = True) -> None:
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

    def _require_fewer_deaths(self) -> None:
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

    def _failed(self, failure: JobFailure) -> JobFailedError:
        _log.warning("training job failed", job=self._id, type=failure.type, reason=failure.message)
        self._remove_work()
        return JobFailedError(failure)

    def _remove_work(self) -> None:
        try:
            self._store.remove_work(self._id)
        except StoreError as error:  # no reason to fail; the worker comes back to it
            _log.warning("work files stay for now", job=self._id, reason=str(error))


def _deaths(row: WorkflowStatus) -> int:
    """Attempts that ended with their worker, before this one."""
    return (row.recovery_attempts or 1) - 1 - _noted(row, "hand_backs")


def _noted(row: WorkflowStatus, name: str) -> int:
    return int((row.attributes or {}).get(name, 0))


def _share(phase: str, part: float) -> float:
    """The share of a job that is done, `part` of the way through a phase."""
    phases = list(_SHARES)
    start = _SHARES[phase]
    end = _SHARES[phases[min(phases.index(phase) + 1, len(phases) - 1)]]
    return start + (end - start) * min(max(part, 0.0), 1.0)
