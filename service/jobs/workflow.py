"""One training job as a durable workflow: short steps whose results dbos keeps, so that any worker can go on.

    prepare -> fit, a few seconds at a time -> evaluate -> publish -> candidate -> champion -> tidy up

What a step needs and did not get from the steps before it is computed again, which gives the same: everything here is
deterministic but the clock. A step that was killed runs again from its start, so each one may run twice.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import cached_property
from itertools import islice
from typing import Any

import structlog
from dbos import DBOS

from model_store import CorruptArtefactError, FileEntry, StoreError
from service import tracing
from service.jobs.attempt import Attempt, Runner, came_with
from service.jobs.failure import JobFailedError, failure_of
from service.jobs.job import WORKFLOW, JobFailure, JobResult
from service.jobs.request import TrainingJobRequest, stored_request
from service.learning.evaluate import summarise
from service.learning.network.fit_state import FitState
from service.training.architectures import Fitting, Prepared, begin_fit
from service.training.promotion import CANDIDATE, CHAMPION, JobVersion, describe_move, judge, move_candidate
from service.training.same_weights import same_weights_as
from service.training.train import Trained, evaluate_fitted, prepare, publish_trained

CHUNK_S = 3.0
# Of dbos's own: only for what dies before it can count. Hand-backs count there, so it is far above ours.
_MOST_ATTEMPTS = 1000

_log = structlog.get_logger(__name__)


def register_workflow(runner: Runner) -> None:
    """Tell dbos how jobs are run; before it is launched."""

    def train(request: dict[str, Any], actor: str) -> dict[str, Any]:
        job_id = DBOS.workflow_id
        assert job_id is not None
        runner.enter(job_id)
        try:
            with tracing.continued("training job", came_with(runner, job_id), {"rover_twin.job": job_id}):
                return _Job(runner, job_id, stored_request(request), actor).run()
        finally:
            runner.leave(job_id)

    DBOS.workflow(name=WORKFLOW, max_recovery_attempts=_MOST_ATTEMPTS)(train)


class _Job:
    """The steps of a job. What one attempt has computed lives as long as that attempt."""

    def __init__(self, runner: Runner, job_id: str, request: TrainingJobRequest, actor: str) -> None:
        self._runner = runner
        self._store = runner.store
        self._id = job_id
        self._request = request
        self._actor = actor
        self._attempt = Attempt(runner, job_id)
        self._fitting: Fitting | None = None
        self._trained: Trained | None = None

    def run(self) -> dict[str, Any]:
        """All steps, or those that no earlier attempt has finished. Raises JobFailedError when one fails."""
        try:
            self._attempt.require_fewer_deaths()
            self._attempt.step(self._prepare)
            fit = self._fit()
            metrics = self._attempt.step(self._evaluate, fit)
            published = self._attempt.step(self._publish, fit)
            version = published["version"]
            candidate = self._attempt.step(self._name_candidate, version)
            judged = self._attempt.step(self._judge, version)
            self._attempt.step(self._tidy)
        except Exception as error:
            raise self._failed(failure_of(error)) from None
        moves = [candidate, *judged["moves"]]
        result = JobResult(
            model=self._request.model,
            version=version,
            metrics=metrics,
            comparison=judged["comparison"],
            same_weights_as=published.get("same_weights_as"),  # not of a job that an earlier release began
            promoted=any(move["alias"] == CHAMPION for move in moves),
            moves=tuple(moves),
        )
        return result.model_dump(mode="json")

    # ---- the steps

    def _prepare(self) -> dict[str, Any]:
        split = self._prepared.split
        self._attempt.tell(f"{len(split.train)} runs to train on, {len(split.test)} kept for testing")
        return {"train_runs": len(split.train), "test_runs": len(split.test)}

    def _fit(self) -> dict[str, Any]:
        """Chunk after chunk until the fit is finished or its time is up; the last chunk's account of itself."""
        done: dict[str, Any] = {"finished": False, "seconds": 0.0, "epoch": 0, "file": None}
        while not done["finished"]:
            done = self._attempt.step(self._fit_chunk, done)
        return done

    def _fit_chunk(self, before: dict[str, Any]) -> dict[str, Any]:
        started = time.monotonic()
        network = self._fitting_after(before).network
        if network is None:  # no epochs: solved here and now
            self._attempt.show("fitting", 0.0)
            self._complete(before)
            return {**before, "finished": True, "seconds": time.monotonic() - started}
        for reached in network.epochs():
            self._attempt.show_epoch(reached)
            if self._runner.is_ending() or time.monotonic() - started >= CHUNK_S:
                break
        seconds = before["seconds"] + time.monotonic() - started
        finished = network.finished or seconds >= 60 * self._request.budget.max_minutes
        file = self._save(network.state(), before["file"])
        return {"finished": finished, "seconds": seconds, "epoch": network.epoch, **file}

    def _save(self, state: FitState, before: str | None) -> dict[str, Any]:
        file = f"fit-{state.epoch:06d}.safetensors"
        kept = self._store.put_work(self._id, file, state.to_bytes())
        for name in self._store.work_names(self._id):  # a replayed chunk may want the state before this one
            if name not in (file, before):
                self._store.remove_work(self._id, name)
        return {"file": file, "sha256": kept.sha256, "size_bytes": kept.size_bytes}

    def _evaluate(self, fit: dict[str, Any]) -> dict[str, Any]:
        trained = self._complete(fit)
        self._attempt.show("evaluating", 1.0)
        return {
            "test": summarise(trained.test_evaluations),
            "left_out": summarise(trained.left_out_evaluations),
            "train": summarise(trained.train_evaluations),
        }

    def _publish(self, fit: dict[str, Any]) -> dict[str, Any]:
        published = self._store.published_once(self._request.model, self._id)
        if published is None:
            trained = self._complete(fit)
            self._attempt.show("publishing", 0.0)
            published = publish_trained(
                self._store,
                self._prepared.config,
                trained,
                created_by=self._actor,
                command=f"training job {self._id}",
                job=self._id,
                check=lambda: self._attempt.look(now=True),
            )
        self._attempt.tell(f"published {published.name}@{published.version}")
        same = same_weights_as(self._store, published)
        if same:
            self._attempt.tell(f"its weights are those of {same}")
        return {"version": published.version, "same_weights_as": same}

    def _name_candidate(self, version: int) -> dict[str, Any]:
        move = move_candidate(self._store, self._version(version))
        self._attempt.tell(f"{self._request.model}@{CANDIDATE} is version {version}")
        return describe_move(CANDIDATE, move)

    def _judge(self, version: int) -> dict[str, Any]:
        self._attempt.show("judging", 0.0)
        wanted = self._request.promote == "if_better"
        judged = judge(
            self._store,
            self._version(version),
            margin=self._request.margin,
            promote=wanted,
            check=lambda: self._attempt.look(now=True),
        )
        self._attempt.tell(judged.comparison.sentence())
        moves = [describe_move(CHAMPION, judged.move)] if judged.move else []
        if moves:
            self._attempt.tell(f"{self._request.model}@{CHAMPION} is version {version}")
        return {"comparison": judged.comparison.describe(), "moves": moves}

    def _tidy(self) -> dict[str, Any]:
        self._remove_work()
        self._attempt.show("done", 1.0)
        return {}

    # ---- what steps are made of

    @cached_property
    def _prepared(self) -> Prepared:
        self._attempt.show("loading", 0.0)
        return prepare(self._store, self._request.training_config(), self._attempt.tell)

    def _complete(self, done: dict[str, Any]) -> Trained:
        """The finished model, computed once in an attempt."""
        if self._trained is None:
            fitting = self._fitting_after(done)
            for _ in islice(fitting.epochs(), done["epoch"] - fitting.epoch):  # only where its state was damaged
                self._attempt.look()
            fitted = fitting.finish()
            if fitting.network:  # several attempts may have fitted
                fitted = replace(fitted, outcome=replace(fitted.outcome, elapsed_s=done["seconds"]))
            self._attempt.show("evaluating", 0.0)
            self._trained = evaluate_fitted(self._prepared, fitted, self._attempt.tell, self._attempt.look)
        return self._trained

    def _fitting_after(self, done: dict[str, Any]) -> Fitting:
        """The fit as the chunk that says `done` left it."""
        if self._fitting is None or self._fitting.epoch != done["epoch"]:
            tell, look = self._attempt.tell, self._attempt.look
            self._fitting = begin_fit(self._prepared, self._load_state(done), announce=tell, check=look)
        return self._fitting

    def _load_state(self, done: dict[str, Any]) -> FitState | None:
        """The state that a chunk left; None before the first, and where its file is damaged: then it is fitted anew."""
        if done["file"] is None:
            return None
        entry = FileEntry(sha256=done["sha256"], size_bytes=done["size_bytes"])
        try:
            state = FitState.from_bytes(self._store.read_work(self._id, done["file"], entry))
        except CorruptArtefactError as error:
            self._attempt.tell(f"the saved state cannot be used, the fit starts again: {error}")
            return None
        self._attempt.tell(f"going on after epoch {done['epoch']}")
        return state

    def _version(self, version: int) -> JobVersion:
        return JobVersion(self._request.model, version, self._id, self._actor)

    def _failed(self, failure: JobFailure) -> JobFailedError:
        _log.warning("training job failed", job=self._id, type=failure.type, reason=failure.message)
        self._remove_work()
        return JobFailedError(failure)

    def _remove_work(self) -> None:
        try:
            self._store.remove_work(self._id)
        except StoreError as error:  # no reason to fail; the worker comes back to it
            _log.warning("work files stay for now", job=self._id, reason=str(error))
